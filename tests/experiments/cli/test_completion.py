"""What the shell offers, asked as a shell asks."""

import os
import subprocess
import sys

import pytest
from bsa.experiments.cli import completion
from bsa.plugins.pybamm.before_search.presets import presets
from bsa.plugins.pybamm.cells import parameter_sets

BSA = "import sys; sys.argv[0] = 'bsa'; from bsa.experiments.cli.main import main; main()"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("bsa ", "discover"),
        ("bsa run --scaffold hy", "hybrid"),
        ("bsa run --search ", "geometry"),
        ("bsa run --backend ru", "rules"),
        ("bsa discover --data a.csv b.csv --parameters Ch", "Chen2020"),
        ("bsa discover --search par", "particles"),
        ("bsa grid main", "main-table"),
    ],
)
def test_the_shell_is_offered(typed: str, offered: str) -> None:
    words = typed.split(" ")
    asked = {"_BSA_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(len(words) - 1)}
    command = [sys.executable, "-c", BSA]
    answer = subprocess.run(command, env=os.environ | asked, capture_output=True, text=True, timeout=60, check=False)
    found = answer.stdout.split()
    assert offered in found
    assert all(word.startswith(words[-1]) for word in found)


def test_names_are_those_that_the_commands_know() -> None:
    assert set(parameter_sets.set_names()) <= set(completion.parameter_sets())
    assert completion.search_presets() == list(presets())
    assert "self-heating" in completion.effects()


@pytest.mark.slow
def test_nothing_heavy_is_imported_to_complete() -> None:
    names = "tasks scaffolds grids backends readers effects current_signs parameter_sets search_presets"
    code = (
        "import sys; from bsa.experiments.cli import completion as c; "
        f"[getattr(c, n)() for n in '{names} uncertain_presets'.split()]; "
        "assert not {'pybamm', 'torch', 'litellm', 'matplotlib'} & set(sys.modules), 'heavy'"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
