"""What a discovery remembers of what it was asked, so that it is resumed with the same alone."""

import os
from dataclasses import replace

import pytest
from bsa.core.errors import BsaError
from bsa.core.run.journal import read_events
from bsa.core.task import CellModel
from bsa.experiments import run
from bsa.experiments.discovery_case import DiscoverOptions
from bsa.experiments.discovery_journal import opened, read_options
from bsa_toy_cell import toy_task


@pytest.fixture
def asked(tmp_path):
    """Options of a discovery in the folder ``out``."""
    (tmp_path / "a.csv").write_text("Test Time / s,Voltage / V,Current / A\n0,3.9,-2\n1,3.8,-2\n")
    return lambda **more: DiscoverOptions(**{"data": [tmp_path / "a.csv"], "out": tmp_path / "out", **more})


def begin(options):
    with opened(options) as journal:
        journal.file.append("end", status="")


def resume(folder):
    with opened(read_options(folder)) as journal:
        return list(journal.file.warnings)


@pytest.mark.parametrize("name", ["", "best_parameters.json"])
def test_a_run_that_went_on_is_another_base_model(name, asked, tmp_path, run_toy):
    cell = replace(toy_task(), cell=CellModel("Chen2020", "SPM"))
    run_toy(tmp_path / "run", task=cell, simulations=2)
    begin(asked(parameters=str(tmp_path / "run" / name)))
    assert resume(tmp_path / "out") == []
    run_toy(tmp_path / "run", task=cell, simulations=30, rebudgeted=True)
    with pytest.raises(BsaError, match=r"a discovery with other .*parameters") as refused:
        resume(tmp_path / "out")
    assert refused.value.hint == "choose another --out folder, or restore what it began with."


def test_a_search_file_that_changed_is_noticed_from_any_folder(asked, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "search.yaml"
    file.write_text("factors: {Cyclable lithium factor: }")
    begin(asked(parameters="Chen2020", search="search.yaml"))
    (tmp_path / "elsewhere").mkdir()
    os.chdir(tmp_path / "elsewhere")
    assert resume(tmp_path / "out") == []
    file.write_text("factors: {Separator porosity factor: }")
    with pytest.raises(BsaError, match="a discovery with other search"):
        resume(tmp_path / "out")


def test_a_journal_without_digests_of_the_base_model_is_resumed(asked, tmp_path):
    file = tmp_path / "search.yaml"
    file.write_text("factors: {Cyclable lithium factor: }")
    begin(asked(parameters="Chen2020", search=str(file)))
    path = tmp_path / "out" / "journal.jsonl"
    first, *others = path.read_text().splitlines(keepends=True)
    start, found, end = first.partition(',"parameters":"","search":"')
    assert found
    path.write_text(start + end.partition('"')[2] + "".join(others))
    assert {"parameters", "search"}.isdisjoint(next(read_events(tmp_path / "out")))
    assert resume(tmp_path / "out") == []


def test_other_versions_are_told(asked, tmp_path, monkeypatch):
    monkeypatch.setattr(run, "version", lambda name: "1.0")
    begin(asked(parameters="Chen2020"))
    assert resume(tmp_path / "out") == []
    monkeypatch.setattr(run, "version", lambda name: "2.0" if name == "pybamm" else "1.0")
    (told,) = resume(tmp_path / "out")
    assert told.endswith("with other versions than the run began with: pybamm 1.0 -> 2.0.")


def test_a_folder_that_is_called_like_the_parameter_set_is_no_base_model(asked, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    begin(asked(parameters="Chen2020", out=tmp_path / "Chen2020"))
    assert resume(tmp_path / "Chen2020") == []
    assert next(read_events(tmp_path / "Chen2020"))["options"]["parameters"] == "Chen2020"
