"""What is said of the effects that a search might add to its model."""

from collections.abc import Iterator, Sequence

from ..core.offered_effects import absent_effects
from ..core.printable import counted
from ..core.run.answer import answer, most_probable
from ..core.task import Task
from ..core.trial import Trial


def offered_notes(task: Task, trials: Sequence[Trial]) -> Iterator[str]:
    """A sentence about each effect that the task offers and some of its trials have."""
    found = answer(task, trials)
    left_out = absent_effects(task, found.candidate)
    for effect, parameters in task.cell.offered.items():
        having = [trial for trial in trials if effect not in absent_effects(task, trial.candidate)]
        if not having:
            continue
        best = most_probable(task, having) if effect in left_out else found
        other = most_probable(task, [trial for trial in trials if effect in absent_effects(task, trial.candidate)])
        more = counted(len(parameters), "more parameter")
        misfits = f"misfit {best.misfit:.3g} tolerances with {more}, {other.misfit:.3g} without"
        if effect in left_out:
            yield f"The effect {effect} was tried and left out: the fit with it is not more probable ({misfits})."
        else:
            yield f"The effect {effect} is in the model: the fit with it is more probable ({misfits})."
