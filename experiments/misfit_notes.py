"""What the misfit of a fit to records shows that its parameters cannot remove, and what to try."""

from collections.abc import Iterator

import numpy as np

from ..core.inference.identifiability import is_structured
from ..core.task import Task
from ..core.trajectory import StepKind, Trajectory
from ..core.trial import Trial
from .tasks.measured_cell import RESISTANCE

_LONG_REST_S = 1800.0
"""Rest that tells slow relaxation from that of particles and electrolyte, which takes minutes."""

_GOES_ON_V = 0.03
"""Rise of the measured voltage beyond the simulated one, in such a rest, that is told: twice the 15 mV by which
published potentials of one chemistry differ. Of 19 rests of two cells five show 67 to 140 mV and all others none."""

_SLOW = "slow-active-material"


def misfit_notes(task: Task, best: Trial, to_discover: str) -> list[str]:
    """Sentences about the best candidate's misfit. ``to_discover`` is the command that looks for what is missing."""
    notes = []
    if best.residuals is not None and is_structured(best.residuals):
        notes.append(
            "The misfit that is left is larger than the noise and follows the curve: the model may lack an effect, if "
            f"more simulations do not remove it. To look for it: {to_discover}"
        )
    rise = max(_rises_beyond(task, best), default=0.0)
    if rise > _GOES_ON_V and not any(name.startswith(_SLOW) for name in task.cell.effects):
        notes.append(
            f"In a rest after a discharge the measured voltage goes on rising, by {1e3 * rise:.0f} mV more than the "
            "simulated one: a part of an electrode may exchange lithium slowly, as silicon does beside graphite. To "
            f"try it: --effect {_SLOW}.negative-electrode --search silicon-cell"
        )
    if _shows_too_much_at_once(task, best):
        notes.append(
            "The contact resistance ended at its lower bound, although the records hold pulses: the simulated "
            "resistance is too large at once, or grows too little in the seconds after. The pores of the electrodes "
            "may be more tortuous than in the parameter set. To try it: --search pulsed-cell"
        )
    return notes


def _shows_too_much_at_once(task: Task, best: Trial) -> bool:
    """Whether pulses leave no resistance for the contacts, and the tortuosity of the pores is not searched."""
    searched = task.space.names
    if RESISTANCE not in searched or any("Bruggeman" in name for name in searched):
        return False
    pulsed = any(step.kind is StepKind.PULSE for e in task.experiments for step in e.target.steps)
    return pulsed and task.space[RESISTANCE].bound_at(best.candidate[RESISTANCE]) == "lower"


def _rises_beyond(task: Task, best: Trial) -> Iterator[float]:
    """For each long rest behind a discharge: rise of the measured voltage beyond the simulated one, V."""
    for experiment, simulated in zip(task.experiments, best.curves or (), strict=False):
        if simulated is None or experiment.is_spectrum or "voltage" not in simulated.signals:
            continue
        measured = experiment.target
        if len(simulated.steps) != len(measured.steps):
            continue
        for number in range(1, len(measured.steps)):
            kinds = (measured.steps[number - 1].kind, measured.steps[number].kind)
            if kinds == (StepKind.CC_DISCHARGE, StepKind.REST):
                yield _rise(measured, number) - _rise(simulated, number)


def _rise(trajectory: Trajectory, number: int) -> float:
    """Rise of the voltage in a long rest without its first tenth, V; 0 in a short one.

    The first tenth has the relaxation that every model has, and what is left of the knee of the discharge.
    """
    step = trajectory.steps[number]
    time, voltage = (signal[step.start : step.stop] for signal in (trajectory.time, trajectory.voltage))
    if time[-1] - time[0] < _LONG_REST_S:
        return 0.0
    return float(voltage[-1] - np.interp(time[0] + 0.1 * (time[-1] - time[0]), time, voltage))
