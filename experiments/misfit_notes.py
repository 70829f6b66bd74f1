"""What the misfit of a fit to records shows that its parameters cannot remove, and what to try."""

import shlex
from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np

from ..core.comparison.slow_rests import GOES_ON_V, rises_beyond
from ..core.inference.identifiability import is_structured
from ..core.inference.observations import Observations
from ..core.task import Task
from ..core.trajectory import FloatArray, StepKind
from ..core.trial import Trial
from .tasks.measured_cell import RESISTANCE

_SLOW = "slow-active-material"
_IN_A_FIT = f"--effect {_SLOW}.negative-electrode"
_OFTEN = (
    "In many measured cells a part of the negative electrode exchanges lithium slowly, which explains much of such a "
    f"misfit. To fit with it: {_IN_A_FIT}"
)


def misfit_notes(task: Task, best: Trial, to_discover: str, offered: Collection[str] = ()) -> list[str]:
    """Sentences about the best candidate's misfit.

    ``to_discover`` is the command that looks for what is missing, ``offered`` are effects that the search might add.
    """
    notes = []
    structured = best.residuals is not None and is_structured(best.residuals)
    if structured:
        notes.append(
            "The misfit that is left is larger than the noise and follows the curve: the model may lack an effect, if "
            f"more simulations do not remove it. To look for it: {to_discover}"
        )
    if not any(name.startswith(_SLOW) for name in (*task.cell.effects, *offered)):
        driven = any(one.protocol is None and not one.is_spectrum for one in task.experiments)
        notes += _slow_rest(_rises_of(task, best), _IN_A_FIT) or [_OFTEN] * (structured and driven)
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


def discovery_notes(
    observations: Sequence[Observations], errors: Sequence[FloatArray], considered: Iterable[str]
) -> list[str]:
    """Sentences about what an explanation leaves, that effects which are considered on request might explain.

    ``errors`` are measured minus simulated voltage by record, V, and ``considered`` the names of the effects that were.
    """
    if _SLOW in considered:
        return []
    compared = zip(observations, errors, strict=True)
    rises = (rise for seen, error in compared for rise in rises_beyond(seen.measured_record.record, seen.time, error))
    return _slow_rest(rises, f"bsa-run with {_IN_A_FIT}, or a discovery with --effect {_SLOW}")


def potentials_note(parameters: str) -> str:
    """What is to be said where nothing explains what a published cell leaves of measured records."""
    return (
        f"The base model has the open-circuit potentials of {parameters} as they are. Those of a cell of another maker "
        "differ by more than most effects change. A staged fit corrects them (bsa-run --data FILE... --parameters "
        f"{shlex.quote(parameters)} --scaffold staged --out CELL), and a discovery can begin with it (--parameters "
        "CELL)"
    )


def _slow_rest(rises: Iterable[float], how: str) -> list[str]:
    rise = max(rises, default=0.0)
    if rise <= GOES_ON_V:
        return []
    return [
        f"In a rest after a discharge the measured voltage goes on rising, by {1e3 * rise:.0f} mV more than the "
        "simulated one: a part of an electrode may exchange lithium slowly, as silicon does beside graphite. To "
        f"try it: {how}"
    ]


def _rises_of(task: Task, best: Trial) -> Iterator[float]:
    for experiment, simulated in zip(task.experiments, best.curves or (), strict=False):
        if simulated is None or experiment.is_spectrum or "voltage" not in simulated.signals:
            continue
        measured = experiment.target
        clock = measured.time - measured.time[0]
        error = measured.voltage - np.interp(clock, simulated.time - simulated.time[0], simulated.voltage)
        yield from rises_beyond(measured, measured.time, error)
