"""Task files of cells: what stands in them is what is read."""

from __future__ import annotations

from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.tasks.find import find_task
from bsa.experiments.tasks.task_file import load_task_file

HEAD = "Date,Time [s],Current [A],Voltage [V]\n"


def part(path: Path, date: str, first_v: float) -> None:
    """Twenty minutes of discharge at 2.5 A between rests, from a date on."""
    rows = [f"{date},{60 * n},{-2.5 if 5 <= n < 25 else 0.0},{first_v - 0.01 * n:.3f}" for n in range(31)]
    path.write_text(HEAD + "\n".join(rows) + "\n", encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    part(tmp_path / "later.csv", "2024-05-02 10:00:00", 3.6)
    part(tmp_path / "first.csv", "2024-05-01 10:00:00", 4.0)
    text = "name: joined\nparameter_set: Chen2020\nmodel: SPM\nsearch: geometry\n"
    (tmp_path / "task.yaml").write_text(
        text + "experiments: [{data: [later.csv, first.csv], initial_soc: 0.9}]\n", encoding="utf-8"
    )
    return tmp_path


def test_several_files_of_one_cell_are_one_record(folder: Path) -> None:
    (experiment,) = load_task_file(folder / "task.yaml").experiments
    assert len(experiment.target) == 62
    assert experiment.target.discharge_capacity[-1] == pytest.approx(2 * 2.5 / 3.0, rel=0.1)
    assert any("joined" in note for note in load_task_file(folder / "task.yaml").notes)


def test_an_ending_in_capitals_is_one_of_a_task_file(folder: Path) -> None:
    (folder / "task.yaml").rename(folder / "TASK.YAML")
    assert find_task(str(folder / "TASK.YAML")).name == "joined"
    (folder / "TASK.JSON").write_text("{", encoding="utf-8")
    with pytest.raises(BsaError, match="is not valid JSON"):
        find_task(str(folder / "TASK.JSON"))


@pytest.mark.parametrize("said", [True, False])
def test_a_temperature_that_is_given_is_not_guessed(tmp_path: Path, said: bool) -> None:
    rows = [f"{60 * n},{-2.5 if 5 <= n < 25 else 0.0},{4 - 0.01 * n:.3f},{25 + 0.02 * n:.2f}" for n in range(31)]
    text = "Time [s],Current [A],Voltage [V],Temperature [degC]\n" + "\n".join(rows) + "\n"
    (tmp_path / "warm.csv").write_text(text, encoding="utf-8")
    entry = "data: warm.csv, initial_soc: 0.9" + ", temperature_degc: 20" * said
    task = f"name: warm\nparameter_set: Chen2020\nmodel: SPM\nsearch: geometry\nexperiments: [{{{entry}}}]\n"
    (tmp_path / "task.yaml").write_text(task, encoding="utf-8")
    loaded = load_task_file(tmp_path / "task.yaml")
    assert any("ambient temperature is taken" in note for note in loaded.notes) != said
    assert loaded.experiments[0].temperature_k == pytest.approx(293.15 if said else 298.15)


@pytest.mark.parametrize(
    ("entry", "more", "message"),
    [
        ("data: []", "", "no file is given"),
        ("data: first.csv", "overrides: {Negative electrode porosity: .nan}\n", 'porosity" is nan: a finite number'),
    ],
)
def test_what_cannot_be_read_or_simulated_is_told(folder: Path, entry: str, more: str, message: str) -> None:
    text = f"name: a\nparameter_set: Chen2020\nsearch: geometry\n{more}experiments: [{{{entry}}}]\n"
    (folder / "wrong.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(BsaError, match=message):
        load_task_file(folder / "wrong.yaml")
