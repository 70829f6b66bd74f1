"""Makes the record of the packaged demonstration: ``python -m bsa.experiments.tasks.demo_record``.

The cell is Chen2020 with hidden changes, simulated on PyBaMM's standard mesh with tight tolerance, sampled
as a cycler would (every 20 s, and where a step ends) and given 0.3 mV of noise.
"""

import numpy as np

from ...core.target import CellChange
from ...core.task import CellModel, Experiment
from ...core.trajectory import Trajectory
from ...plugins.pybamm.solving.experiment_kinds import solve_reference
from ...plugins.readers.bdf import write
from .find import PACKAGED

HIDDEN = {
    "Negative particle radius [m]": 7.1e-6,
    "Positive particle radius [m]": 4.3e-6,
    "Negative electrode thickness [m]": 9.35e-5,
    "Positive electrode thickness [m]": 8.2e-5,
    "Negative electrode porosity": 0.27,
    "Positive electrode porosity": 0.31,
    "Separator thickness [m]": 1.35e-5,
}
"""What the demonstration asks to be found; nothing reads it but this generator."""

PROTOCOL = (
    (
        "Charge at 1C until 4.2 V",
        "Hold at 4.2 V until C/20",
        "Rest for 30 minutes",
        "Discharge at 1C until 2.5 V",
        "Rest for 30 minutes",
    ),
)
NOISE_V = 3e-4
SAMPLING_S = 20.0


def make_record() -> Trajectory:
    """The demonstration's record, current positive on discharge."""
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    experiment = Experiment("demo", nothing, PROTOCOL, initial_soc=0.05)
    run = solve_reference(CellModel("Chen2020"), experiment, CellChange(values=HIDDEN))
    assert run.trajectory is not None
    assert run.failure is None
    times, currents, voltages = [], [], []
    for _, piece in run.trajectory.pieces():
        # Where the current jumps, a cycler logs the end of one step and, a moment later, the start of the next.
        start, end = piece.time[0] + 0.01, piece.time[-1]
        time = np.append(np.arange(start, end, SAMPLING_S), end)
        times.append(time)
        currents.append(np.interp(time, piece.time, piece.current))
        voltages.append(np.interp(time, piece.time, piece.voltage))
    noise = np.random.default_rng(7).normal(0.0, NOISE_V, sum(map(len, times)))
    time, current = np.concatenate(times), np.concatenate(currents)
    return Trajectory(time.round(2), current.round(5), (np.concatenate(voltages) + noise).round(5))


if __name__ == "__main__":
    write(make_record(), PACKAGED / "demo.csv", steps=False)
