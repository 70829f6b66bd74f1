"""How far an exported cell is from the run's own."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.target import CYCLABLE_LITHIUM, CellChange, target_named
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Trajectory
from bsa.experiments import export_cell
from bsa.experiments.export_cell import Difference, difference_on, exported


@pytest.mark.slow
def test_a_step_that_ends_a_little_earlier_is_no_difference_of_the_curves() -> None:
    steps = (
        "Discharge at 1C until 3.2 V",
        "Rest for 10 minutes",
        "Charge at 1C until 4.1 V",
        "Hold at 4.1 V until C/10",
    )
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    experiment = Experiment("cycle", nothing, (steps,), initial_soc=0.9)
    ours = CellModel("Chen2020", "SPM")
    width = 1.58
    theirs = CellModel("Chen2020", "SPM", overrides={"Electrode width [m]": 0.99 * width})
    same = difference_on(experiment, (ours, CellChange()), (ours, CellChange()))
    assert same is not None
    assert same.largest_mv == same.rms_mv == 0.0
    different = difference_on(experiment, (ours, CellChange()), (theirs, CellChange()))
    assert different is not None
    assert 0.1 < different.largest_mv < 60.0  # 154 mV at equal times
    assert 0.0 < different.rms_mv < different.largest_mv
    assert 0.0 < different.at_s <= different.duration_s


def test_a_file_that_is_off_says_where() -> None:
    assert Difference(0.4, 0.1, 20.0, 7309.0).words.endswith("within 0.4 mV of the run's own cell.")
    off = Difference(21.0, 0.62, 7301.0, 7309.0).words
    assert "within 21 mV of the run's own cell, farthest off at 7,301 s of 7,309 s (0.62 mV rms): more than" in off


@pytest.mark.parametrize("effects", [(), ("ocp-hysteresis",)])
def test_parameter_values_say_that_an_effect_is_not_in_them(effects: tuple[str, ...], monkeypatch) -> None:
    rest = Experiment("rest", Trajectory(np.zeros(1), np.zeros(1), np.zeros(1)), (("Rest for 1 minute",),))
    space = ParameterSpace((Parameter(CYCLABLE_LITHIUM, 1.0, 0.5, 1.5, target=target_named(CYCLABLE_LITHIUM)),))
    task = Task("t", CellModel("Chen2020", "SPM", effects=effects), space, (rest,))
    run = SimpleNamespace(task=task, best=SimpleNamespace(candidate={CYCLABLE_LITHIUM: 1.0}))
    monkeypatch.setattr(export_cell, "read_finished", lambda folder: run)
    _, remarks = exported(Path("run"), "parameter-values")
    assert ["ocp-hysteresis" in remark for remark in remarks] == [True] * len(effects)
