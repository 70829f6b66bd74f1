"""Measured cells as a study: what is absent is skipped and named, and every record gives a row."""

from __future__ import annotations

import csv
from pathlib import Path
from types import SimpleNamespace

import pytest
from bsa.core.errors import BsaError
from bsa.core.files import write_csv
from bsa.experiments.cli.main import app
from bsa.experiments.studies import real_cells
from bsa.experiments.studies.real_cells import Row, cells, chosen, line_of, missing, run_cell, run_cells, with_earlier
from bsa.experiments.tasks import demo_record
from bsa.experiments.tasks.task_file import TaskFile
from typer.testing import CliRunner

DEMO = Path(demo_record.__file__).parent / "packaged"


def cell(name: str, *records: str, held_out: tuple[str, ...] = ()) -> TaskFile:
    return TaskFile.model_validate(
        {
            "name": name,
            "parameter_set": "Chen2020",
            "model": "SPM",
            "search": {"Contact resistance [Ohm]": [0.0, 0.1]},
            "options": {"contact resistance": "true"},
            "experiments": [{"data": record} for record in records],
            "held_out": [{"data": record} for record in held_out],
        }
    )


def record_row(name: str, rms_mv: float) -> Row:
    return {"cell": name, "record": "r", "role": "fitted", "rms_mv": rms_mv, "rms_k": float("nan"), "failure": ""}


def test_the_cells_are_known_by_name() -> None:
    assert [cell.name for cell in chosen(["NASA B0005"])] == ["NASA B0005"]
    assert len(chosen([])) == len(cells())
    with pytest.raises(BsaError, match='no measured cell "NASA B0006"'):
        chosen(["NASA B0006"])


def test_a_cell_without_its_records_is_skipped_with_the_reason(tmp_path: Path) -> None:
    def run(wanted: TaskFile, folder: Path) -> list[Row]:
        return [record_row(wanted.name, 1.0)]

    (tmp_path / "here.csv").touch()
    wanted = [cell("here", "here.csv"), cell("gone", "here.csv", held_out=("gone.csv",))]
    rows, remarks = run_cells(wanted, tmp_path, tmp_path / "out", run)
    assert [row["cell"] for row in rows] == ["here"]
    assert remarks == [f"gone is skipped: {tmp_path} lacks gone.csv."]
    assert missing(wanted[1], tmp_path) == ["gone.csv"]
    assert missing(cell("one test of a file", "here.csv#1C", held_out=("gone.csv#2C",)), tmp_path) == ["gone.csv#2C"]


@pytest.mark.parametrize(("option", "study"), [((), "real_cells"), (("--paper",), "paper_cells")])
def test_the_command_says_what_it_skips(tmp_path: Path, option: tuple[str, ...], study: str) -> None:
    asked = ["bench", "real-cells", "--data", str(tmp_path), "--out", str(tmp_path / "out"), *option]
    result = CliRunner().invoke(app(), asked)
    assert result.exit_code == 1, "as for every study that has cells without a result"
    assert result.output.count("is skipped") == len(cells(study))
    assert not (tmp_path / "out").exists()


def test_a_table_keeps_the_rows_of_the_cells_that_were_not_run(tmp_path: Path) -> None:
    first, second, *_ = (known.name for known in cells())
    path = tmp_path / "real_cells.csv"
    write_csv(path, with_earlier([record_row(first, 1.0), record_row(second, 2.0)], path))
    before = path.read_bytes()
    write_csv(path, with_earlier([record_row(second, 3.0)], path))
    assert path.read_bytes() == before.replace(b"fitted,2.0", b"fitted,3.0")
    write_csv(path, with_earlier([record_row(first, 4.0)], path))
    with path.open(newline="") as file:
        assert [(entry["cell"], entry["rms_mv"]) for entry in csv.DictReader(file)] == [(first, "4.0"), (second, "3.0")]


@pytest.mark.slow
def test_every_record_gives_a_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(real_cells, "cells", lambda study: (cell("demo", "demo.csv"),))
    (wanted,) = chosen([])
    (row,) = run_cell(wanted, DEMO, tmp_path / "run", "staged", simulations=1, seed=1, workers=1)
    assert (row["cell"], row["role"], row["simulations"]) == ("demo", "fitted", 1)
    assert 0.0 < row["rms_99_mv"] <= row["rms_mv"] <= row["max_mv"]
    assert line_of(row).startswith(f"demo, {row['record']} (fitted): ")
    assert (tmp_path / "run" / "report.html").is_file()


@pytest.mark.slow
def test_a_cell_whose_steps_are_simulated_gives_the_papers_errors(tmp_path: Path) -> None:
    wanted = cell("demo", "demo.csv")
    simulated = wanted.model_copy(
        update={"experiments": [wanted.experiments[0].model_copy(update={"protocol": "recognised"})]}
    )
    (row,) = run_cell(simulated, DEMO, tmp_path / "run", "hybrid", simulations=1, seed=1, workers=1)
    assert row["mape"] == pytest.approx(row["q_mape"] + row["i_mape"] + row["v_mape"])
    assert (row["simulations"], row["failed"]) == (1, 0)
    assert "demo: total MAPE" in line_of(row)


def test_an_interrupted_cell_stops_the_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(real_cells, "execute_run", lambda *_, **__: SimpleNamespace(status="interrupted"))
    with pytest.raises(KeyboardInterrupt):
        run_cell(cell("demo", "demo.csv"), DEMO, tmp_path / "run", "staged", simulations=1, seed=1, workers=1)
