from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bsa.core.parameters import Candidate, ParameterSpace
from bsa.experiments.studies import whole_life
from bsa.experiments.studies.whole_life import CELLS, FORETOLD, foretell, read_table, space

CALCE = Path(__file__).parents[4] / "shared" / "data" / "calce_cs2"
WIDTH, GROWTH = space().names


def on_paper(count: int, searched: ParameterSpace) -> Callable[[Candidate], np.ndarray]:
    """A life that follows the square root of the cycle number."""
    cycles = np.arange(1.0, count + 1)
    return lambda values: 20.0 * values[WIDTH] - 2.6e7 * np.sqrt(values[GROWTH]) * np.sqrt(cycles) * 1e-3


def written(path: Path, capacity: np.ndarray) -> Path:
    rows = [f"{cycle},{value}" for cycle, value in enumerate(capacity, start=1)]
    path.write_text("\n".join(["cycle,Qd_Arbin", *rows]), encoding="utf-8")
    return path


def test_cycles_that_were_cut_short_are_left_out(tmp_path: Path) -> None:
    capacity = 1.1 - 1e-4 * np.arange(60)
    capacity[[20, 40]] = [0.9, 0.0]
    table = read_table(written(tmp_path / "life.csv", capacity))
    assert set(range(1, 61)) - set(table.cycle) == {21.0, 41.0}


def test_a_life_on_paper_is_foretold_within_its_band(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(whole_life, "_life", on_paper)
    truth = {WIDTH: 1.05 * space()[WIDTH].initial, GROWTH: 3e-20}
    noise = np.random.default_rng(3).normal(0.0, 2e-3, FORETOLD)
    table = read_table(written(tmp_path / "life.csv", on_paper(FORETOLD, space())(truth) + noise))
    rows = list(foretell("paper", table))
    assert [row.cycle for row in rows] == list(range(50, FORETOLD + 1, 50))
    for row in rows:
        assert row.predicted_ah == pytest.approx(row.measured_ah, abs=0.01)
        assert row.low_ah < row.predicted_ah < row.high_ah
    assert rows[-1].high_ah - rows[-1].low_ah < 0.02


@pytest.mark.real_data
@pytest.mark.skipif(not CALCE.is_dir(), reason="the measured cells are not beside this checkout")
@pytest.mark.parametrize("cell", CELLS)
def test_tables_of_measured_lives_are_read(cell: str) -> None:
    table = read_table(CALCE / f"{cell}_percycle.csv")
    assert len(table) > 800
    assert table.at(np.array([200.0]))[0] == pytest.approx(1.0, abs=0.06)
