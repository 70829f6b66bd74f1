"""Tables whose rows are of several cells."""

from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.core.record import ReadOptions

COUNT = 40


def table(path: Path, column: str, labels: list[str], late_s: float = 0.4) -> Path:
    """Two cells, 50 mV apart, in one table; ``labels`` say of which each row is."""
    seen: dict[str, int] = {}
    cells = list(dict.fromkeys(labels))
    lines = [f"{column},Test Time / s,Current / A,Voltage / V"]
    for label in labels:
        k = seen[label] = seen.get(label, -1) + 1
        place = cells.index(label)
        lines.append(f"{label},{20.0 * k + late_s * place},{-1.0 if k > 5 else 0.0},{4.1 - 0.01 * k - 0.05 * place}")
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("column", ["Channel", "Chan ID", "Cell", "cell_id", "通道"])
@pytest.mark.parametrize("late_s", [0.0, 0.4])
def test_cells_that_are_written_in_turn_are_refused_and_one_can_be_chosen(
    column: str, late_s: float, tmp_path: Path
) -> None:
    path = table(tmp_path / "two.csv", column, ["1", "2"] * COUNT, late_s)
    message = f'column "{column}" has 2 values \\("1", "2"\\), which alternate: the rows are of several cells'
    with pytest.raises(BsaError, match=message) as raised:
        read_record(path)
    assert f"{column}=1" in raised.value.hint
    second = read_record(path, ReadOptions(where={column: "2"}))
    assert second.trajectory.voltage == pytest.approx(4.05 - 0.01 * np.arange(COUNT))


def test_a_cell_that_is_moved_to_another_channel_is_one_cell(tmp_path: Path) -> None:
    path = table(tmp_path / "moved.csv", "Channel", ["3"] * COUNT + ["4"] * COUNT, late_s=20.0 * COUNT)
    assert len(read_record(path).trajectory) == 2 * COUNT
    cells = table(tmp_path / "cells.csv", "Cell ID", ["a"] * COUNT + ["b"] * COUNT, late_s=20.0 * COUNT)
    with pytest.raises(BsaError, match="the rows are of several cells") as raised:
        read_record(cells)
    assert "--where 'Cell ID=a'" in raised.value.hint
    assert len(read_record(cells, ReadOptions(join=True)).trajectory) == 2 * COUNT


@pytest.mark.parametrize(
    ("column", "labels"),
    [
        pytest.param("Cell", ["25.1", "25.2"] * COUNT, id="measured numbers"),
        pytest.param("Cell", [str(k) for k in range(COUNT)], id="a number for each row"),
        pytest.param("Range", ["1", "2"] * COUNT, id="another name"),
        pytest.param("Channel", ["7"] * COUNT, id="one channel"),
    ],
)
def test_other_columns_say_nothing_of_cells(column: str, labels: list[str], tmp_path: Path) -> None:
    lines = [f"{column},Test Time / s,Current / A,Voltage / V"]
    lines += [f"{label},{k},{-1.0 if k > 5 else 0.0},{4.1 - 0.005 * k}" for k, label in enumerate(labels)]
    path = tmp_path / "one.csv"
    path.write_text("\n".join(lines))
    assert len(read_record(path).trajectory) == len(labels)
