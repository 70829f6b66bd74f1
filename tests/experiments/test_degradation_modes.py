"""Losses told from the curves of single cycles."""

from pathlib import Path

import pytest
from bsa.experiments.degradation_modes import LITHIUM, degradation_modes, lost_material
from bsa.experiments.read_options import reading
from bsa.experiments.studies.life_discovery import HIDDEN, make
from bsa.experiments.task_request import CellChoice, Records, task_of_records
from bsa.experiments.tasks.measured_cell import RESISTANCE
from bsa.plugins.pybamm.simulators.life_simulator import LifeSimulator


@pytest.mark.slow
def test_a_resistance_that_grows_is_told_from_losses(tmp_path: Path) -> None:
    make(HIDDEN["resistance"], tmp_path / "life.csv", 0, 30)
    read = reading({"time": "time_s", "current": "current_A", "voltage": "voltage_V"}, temperature=25.0)
    choice = CellChoice("Chen2020", "SPM", {"SEI": "none"}, search="cell", scale=False)
    task = task_of_records(Records([tmp_path / "life.csv"], reads=[read], life=True), choice)
    new = {**task.space.initial, RESISTANCE: 1e-3}
    found = {mode.name: mode for mode in degradation_modes(task, new, LifeSimulator(task))}
    growth = found[RESISTANCE]
    assert growth.per_100_cycles == pytest.approx(100 * HIDDEN["resistance"].ohm_per_cycle, rel=0.1)
    assert growth.cycles[-1] == 30
    for name in (LITHIUM, *map(lost_material, ("Negative", "Positive"))):
        assert abs(found[name].values[-1]) < max(0.5, 2.0 * found[name].half[-1]), name
