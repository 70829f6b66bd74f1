"""How far an exported cell is from the run's own."""

import numpy as np
from bsa.core.target import CellChange
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import Trajectory
from bsa.experiments.export_cell import largest_difference_mv


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
    assert largest_difference_mv(experiment, (ours, CellChange()), (ours, CellChange())) == 0.0
    different = largest_difference_mv(experiment, (ours, CellChange()), (theirs, CellChange()))
    assert different is not None
    assert 0.1 < different < 60.0  # 154 mV at equal times
