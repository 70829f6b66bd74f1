"""Effects that a search may add to a model, and the task as a search leaves it, with those alone that it has added.

An offered effect is in the model from the start, absent: its strength begins at the value at which the effect changes
nothing. The names of its parameters stand in `CellModel.offered`, the strength first.
"""

from collections.abc import Iterable
from dataclasses import replace

from .parameters import Candidate, ParameterSpace
from .task import Task
from .trial import Trial


def absent_effects(task: Task, candidate: Candidate) -> tuple[str, ...]:
    """The offered effects that a candidate lacks."""
    return tuple(
        effect
        for effect, (strength, *_) in task.cell.offered.items()
        if candidate[strength] == task.space[strength].initial
    )


def absent_parameters(task: Task, candidate: Candidate) -> tuple[str, ...]:
    """The parameters of the offered effects that a candidate lacks: none of them changes anything."""
    return tuple(name for effect in absent_effects(task, candidate) for name in task.cell.offered[effect])


def added_parameters(task: Task, candidate: Candidate) -> tuple[str, ...]:
    """The parameters of the offered effects that a candidate has."""
    absent = absent_effects(task, candidate)
    return tuple(name for effect, names in task.cell.offered.items() if effect not in absent for name in names)


def as_found(task: Task, best: Trial) -> Task:
    """The task without the offered effects that the best trial lacks, and with the others for good."""
    if not task.cell.offered:
        return task
    absent, unused = absent_effects(task, best.candidate), absent_parameters(task, best.candidate)
    effects = tuple(effect for effect in task.cell.effects if effect not in absent)
    space = ParameterSpace(tuple(parameter for parameter in task.space if parameter.name not in unused))
    return replace(task, cell=replace(task.cell, effects=effects, offered={}), space=space)


def of_the_found(task: Task, found: Task, trials: Iterable[Trial]) -> tuple[Trial, ...]:
    """Those of the trials of a task that are of the found task too, without what that has no parameters for."""
    unused = set(task.space.names) - set(found.space.names)
    return tuple(
        replace(trial, candidate={name: trial.candidate[name] for name in found.space.names}) if unused else trial
        for trial in trials
        if unused.issubset(absent_parameters(task, trial.candidate))
    )
