"""The study of what a life costs, on a short one."""

from pathlib import Path

import pytest
from bsa.experiments.studies.life_cost import cost_table, measure


@pytest.mark.slow
def test_every_way_of_simulating_a_life_gives_its_capacities(tmp_path: Path) -> None:
    rows = measure(tmp_path, 2)["rows"]
    assert [row["way"] for row in rows] == ["cycles left out", "every cycle", "PyBaMM's own experiment"]
    assert all(row["fade_error_pct"] < 0.01 for row in rows)
    assert [row["peak_mb"] for row in rows] == sorted(row["peak_mb"] for row in rows)
    assert "| PyBaMM's own experiment | 2 of 2 |" in cost_table(rows)
