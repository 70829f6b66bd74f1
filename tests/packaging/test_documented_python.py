"""The examples of docs/python.md run as they stand there, one after another."""

import re
import shutil
from pathlib import Path

import bsa
import pytest
from bsa.experiments.tasks.find import PACKAGED

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
PAGES = [*ROOT.glob("*.md"), *sorted((ROOT / "docs").glob("*.md"))]
EXAMPLES = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


@pytest.mark.slow
def test_the_examples_run(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(PACKAGED / "demo.csv", "my_cell.csv")
    Path("thermometer.csv").write_text("time_s,temperature_degC\n0,25\n100000,27\n", encoding="utf-8")
    names: dict[str, object] = {}
    for example in EXAMPLES:
        exec(example, names)
    assert "Voltage RMSE" in capsys.readouterr().out
    assert names["result"].report.is_file()
    assert names["solution"].t[-1] == 600
    assert 298.1 < names["warm"].trajectory.temperature.max() < 300.2


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_example_of_every_page_compiles(page: Path) -> None:
    for example in re.findall(r"(?ms)^```python\n(.*?)^```", page.read_text(encoding="utf-8")):
        compile(example, page.name, "exec")


def test_no_example_is_longer_than_six_lines_or_one_step_of_a_try() -> None:
    assert len(EXAMPLES) == 6
    assert all(len(example.splitlines()) <= 6 for example in EXAMPLES)


def test_the_table_of_results_names_attributes_that_are_there() -> None:
    rows = [line for line in PAGE.splitlines() if line.startswith("| `.")]
    named = {name for row in rows for name in re.findall(r"`\.(\w+)", row.split("|")[1])}
    there = {name for kind in (bsa.CalibrationResult, bsa.DiscoveryResult) for name in dir(kind) if name[0] != "_"}
    assert named == (there | {"folder"}) - {"of"}
