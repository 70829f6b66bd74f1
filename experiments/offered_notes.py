"""What is said of the effects that a search might add to its model."""

from collections.abc import Iterator, Sequence

from ..core.offered_effects import absent_effects
from ..core.prior import Prior
from ..core.run.answer import improbability
from ..core.task import Task
from ..core.trial import Trial


def offered_notes(task: Task, trials: Sequence[Trial]) -> Iterator[str]:
    """A sentence about each effect that the task offers and some of its trials have."""
    prior = Prior.of(task.space)
    for effect, parameters in task.cell.offered.items():
        has = [effect not in absent_effects(task, trial.candidate) for trial in trials]
        if not any(has):
            continue
        best_with, best_without = (
            min(
                (trial for trial, it_has in zip(trials, has, strict=True) if it_has is wanted),
                key=lambda trial: improbability(task, prior, trial),
            )
            for wanted in (True, False)
        )
        known = "is in the model: the fit with it is more probable"
        if improbability(task, prior, best_with) >= improbability(task, prior, best_without):
            known = "was tried and left out: the fit with it is not more probable"
        yield (
            f"The effect {effect} {known} (misfit {best_with.misfit:.3g} tolerances with {len(parameters)} more "
            f"parameters, {best_without.misfit:.3g} without)."
        )
