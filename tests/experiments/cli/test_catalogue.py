"""`bsa list` and `bsa doctor`: every kind, each once, and what cannot be used beside its own kind alone."""

import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from bsa.backends import gpu_memory, transformers_route
from bsa.core.contracts.kinds import KINDS, plural
from bsa.core.contracts.registry import installed
from bsa.experiments.cli.catalogue import doctor
from bsa.experiments.cli.main import main
from bsa.experiments.tasks.find import find_task, unusable_tasks

Install = Callable[..., Path]

STRANGER = """
from bsa.core.hooks import Entry, hookimpl

@hookimpl
def bsa_tasks():
    yield Entry("demo", dict, "Not the one that is found.", api=1)
    yield Entry("zz-task", dict, "Is found.", api=1)

@hookimpl
def bsa_backends():
    yield Entry("zz-model", dict, "A model of another package.", api=1)
    raise OSError("no disk")

@hookimpl
def bsa_memories():
    raise OSError("no memory")

def bsa_readers():
    return []
"""


@pytest.fixture
def printed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """What `bsa` prints."""

    def run(*words: str) -> str:
        monkeypatch.setattr(sys, "argv", ["bsa", *words])
        with pytest.raises(SystemExit) as caught:
            main()
        assert caught.value.code == 0
        return capsys.readouterr().out

    return run


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_a_list_by_its_name_and_its_plural(kind: str, printed: Callable[..., str]) -> None:
    (named,) = [known for known in KINDS if known == kind]
    out = printed("list", kind)
    assert out == printed("list", plural(named))
    lines = out.splitlines()
    assert lines[1] == plural(named)
    own = {item.entry.name for item in installed().listings(named) if item.kind == named}
    assert own <= {line.split()[0] for line in lines[2:] if line}


def test_sets_and_their_parameters_are_those_that_contain_a_text(printed: Callable[..., str]) -> None:
    assert printed("list", "parameters", "--contains", "chen").split() == ["Chen2020"]
    found = printed("list", "parameters", "--set", "Chen2020", "--contains", "particle RADIUS").splitlines()
    assert sorted(found) == ["Negative particle radius [m]: 5.86e-06", "Positive particle radius [m]: 5.22e-06"]


def test_the_whole_list_has_each_heading_once(printed: Callable[..., str]) -> None:
    headings = [line for line in printed("list").splitlines() if line and not line.startswith((" ", "bsa "))]
    assert len(headings) == len(set(headings))
    assert {"tasks", "effects", "scaffolds", "memories"} <= set(headings)


def test_a_task_of_a_built_in_name_is_not_usable(stranger: Install, printed: Callable[..., str]) -> None:
    stranger(STRANGER)
    usable, unusable = printed("list", "tasks").split("not usable\n")
    names = [line.split()[0] for line in usable.splitlines() if line.startswith("  ")]
    assert names.count("demo") == names.count("zz-task") == 1
    assert " ".join(unusable.split()) == "task demo zz-fault 0.1 the name is taken by battery-sim-agent"
    assert [item.name for item in unusable_tasks()] == ["demo"]
    assert find_task("demo").name == "demo"


def test_the_doctor_names_foreign_backends_and_no_faults_of_other_kinds(
    stranger: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    stranger(STRANGER)
    stranger("import no_such_module_zz", "zz-broken")
    doctor()
    backends, rest = capsys.readouterr().out.split("\nroutes\n")
    routes, unusable = rest.split("\nnot usable\n")
    routes, _ = routes.split("\nsimulations\n")
    line = " ".join(next(line for line in backends.splitlines() if "zz-model" in line).split())
    assert line == "zz-model plugin: not checked A model of another package. (zz-fault 0.1)"
    assert "zz-" not in routes
    assert "no disk in bsa_backends" in unusable
    assert "no_such_module_zz" in unusable
    assert "bsa_memories" not in unusable
    assert "bsa_readers" not in unusable


@pytest.mark.parametrize(
    ("name", "line"),
    [("python3", f"C compiler found {shutil.which('python3')}"), ("", "C compiler not found install gcc: ")],
)
def test_the_doctor_says_whether_simulations_are_compiled(
    name: str, line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("BSA_COMPILER", name)
    doctor()
    told = capsys.readouterr().out.split("\nsimulations\n")[1].splitlines()[0]
    assert " ".join(told.split()).startswith(line.strip())


@pytest.mark.parametrize("missing", ["", "transformers"])
def test_the_doctor_looks_for_a_gpu_where_models_can_run_in_this_process(
    missing: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(transformers_route, "find_spec", lambda package: None if package == missing else "there")
    monkeypatch.setattr(gpu_memory, "gpu_in_words", lambda: "GPU: any")
    doctor()
    assert ("\nlocal models\n  GPU: any\n" in capsys.readouterr().out) == (not missing)
