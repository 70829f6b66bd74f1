"""Tasks of a grid: each start of a case is a task of its own."""

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.campaign.grid_file import SuiteFilter, load_grid
from bsa.experiments.campaign.store import Store
from bsa.experiments.campaign.task_sources import gather, suite_cases
from bsa.experiments.suite.build import NoTarget
from bsa.experiments.suite.case import SuiteCase
from bsa_toy_cell import toy_task

from .conftest import write_grid


@pytest.fixture
def one_case(monkeypatch):
    case = SuiteCase("regular", 7, "Chen2020", 1.0, 1.0, {"Negative electrode thickness [m]": 1e-4})
    monkeypatch.setattr("bsa.experiments.suite.selection.generated_cases", lambda: {case.key: case})
    monkeypatch.setattr("bsa.experiments.suite.build.build_task", lambda case, search: toy_task(name=case.key))


def raising(error):
    def build(case, search):
        raise error

    return build


def test_every_start_of_a_case_is_a_task_and_is_kept(one_case, tmp_path):
    store, said = Store(tmp_path), []
    wanted = SuiteFilter(suite="generated", starts=[0, 1, 2])
    labels = gather([wanted], store, tmp_path, said.append)
    assert [label.key for label in labels] == ["regular-7", "regular-7-start-1", "regular-7-start-2"]
    starts = {tuple(store.get_task(label.digest).space.initial.values()) for label in labels}
    assert len(starts) == len(said) == 3
    assert gather([wanted], store, tmp_path, said.append) == labels
    assert len(said) == 3


def test_a_cell_that_cannot_be_simulated_is_noted_and_not_tried_again(one_case, tmp_path, monkeypatch):
    wanted = SuiteFilter(suite="generated")
    monkeypatch.setattr("bsa.experiments.suite.build.build_task", raising(NoTarget("it ends before the scored cycle.")))
    (label,) = gather([wanted], Store(tmp_path), tmp_path)
    assert label.trouble == "it ends before the scored cycle."
    monkeypatch.setattr("bsa.experiments.suite.build.build_task", raising(AssertionError()))
    assert gather([wanted], Store(tmp_path), tmp_path) == [label]


def test_a_full_disk_is_no_fault_of_the_case(one_case, tmp_path, monkeypatch):
    wanted = SuiteFilter(suite="generated")
    with monkeypatch.context() as full:
        full.setattr("bsa.experiments.suite.build.build_task", raising(BsaError("no space is left.")))
        (label,) = gather([wanted], Store(tmp_path), tmp_path)
    assert (label.digest, label.trouble) == ("", "no space is left.")
    (label,) = gather([wanted], Store(tmp_path), tmp_path)
    assert label.digest
    assert not label.trouble


@pytest.mark.parametrize("starts", [[-1], []])
def test_starts_are_checked(tmp_path, starts):
    path = write_grid(tmp_path)
    with pytest.raises(BsaError, match="starts"):
        load_grid(str(path), {"tasks.0": {"suite": "generated", "starts": starts}})


def test_a_filter_that_leaves_nothing_says_of_what(one_case, tmp_path):
    wanted = SuiteFilter(suite="generated", chemistry="Chen2021")
    words = 'no case of the generated suite has the parameter set Chen2021. Hint: did you mean "Chen2020"'
    with pytest.raises(BsaError) as refused:
        gather([wanted], Store(tmp_path), tmp_path)
    assert words in str(refused.value)


def test_a_number_of_cases_is_a_number_in_quotes_too():
    number, quoted = (suite_cases(SuiteFilter(suite="lives", cases=cases, draw=3)) for cases in (4, " 4"))
    assert list(number) == list(quoted)


def test_a_case_of_a_drawn_suite_can_be_named_by_any_number():
    (key,) = suite_cases(SuiteFilter(suite="lives", cases="life-45"))
    assert key == "life-45"
