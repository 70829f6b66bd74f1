"""What is said of the effects that a search might add to its model."""

from collections.abc import Iterator, Sequence

from ..core.offered_effects import absent_effects
from ..core.prior import Prior
from ..core.run.answer import answer, improbability
from ..core.task import Task
from ..core.trial import Trial

_KNEE = (
    " Only the means over parts of the steps come nearer: the end of a discharge is too early or too late. With "
    "--weight knee it counts by all of its error."
)


def offered_notes(task: Task, trials: Sequence[Trial]) -> Iterator[str]:
    """A sentence about each effect that the task offers and some of its trials have."""
    prior, found = Prior.of(task.space), absent_effects(task, answer(task, trials).candidate)

    def least_improbable(those: Sequence[Trial]) -> Trial:
        return min(those, key=lambda trial: improbability(task, prior, trial))

    for effect, parameters in task.cell.offered.items():
        it_has = [effect not in absent_effects(task, trial.candidate) for trial in trials]
        having = [trial for trial, has in zip(trials, it_has, strict=True) if has]
        if not having:
            continue
        best = least_improbable(having)
        other = least_improbable([trial for trial, has in zip(trials, it_has, strict=True) if not has])
        more_probable = improbability(task, prior, best) < improbability(task, prior, other)
        misfits = (
            f"misfit {best.misfit:.3g} tolerances with {len(parameters)} more parameters, {other.misfit:.3g} without"
        )
        if effect not in found:
            yield f"The effect {effect} is in the model: the fit with it is more probable ({misfits})."
        elif more_probable and task.weight == "uniform":
            yield f"The effect {effect} was tried and left out: its voltage error is larger ({misfits}).{_KNEE}"
        else:
            yield f"The effect {effect} was tried and left out: the fit with it is not better ({misfits})."
