"""A task with the effects that a scaffold may add to its model."""

from dataclasses import replace

from ....core.contracts.evidence import gather
from ....core.contracts.requests import MeasuredRecord
from ....core.effect import Effect
from ....core.parameters import ParameterSpace
from ....core.scaffold import Scaffold
from ....core.task import CellModel, Task
from ..augmentation import effects_in


def with_offered(task: Task, scaffold: Scaffold) -> Task:
    """The task with the effects that the scaffold offers, which are absent where its search begins.

    Those alone that its records can show and PyBaMM's model can have and has not yet. None is offered where steps are
    simulated, whose durations a search compares, or where no parameter has a prior. Raises `BsaError` if there is no
    such effect.
    """
    records = [experiment for experiment in task.experiments if not experiment.is_spectrum]
    if not scaffold.offers or scaffold.simulator.use != "pybamm" or task.cell.offered:
        return task
    if not records or not task.given_drive or not task.space.prior_weights.any():
        return task
    own = {effect.name for effect in effects_in(task.cell)}
    measured = [MeasuredRecord(one.name, one.target, one.temperature_k, one.initial_temperature_k) for one in records]
    evidence = gather(task.cell.model, task.cell.options, measured)
    for effect in effects_in(CellModel(task.cell.parameter_set, effects=tuple(scaffold.offers))):
        if effect.name not in own and not effect.lacking(evidence):
            task = _with(task, effect)
    return task


def _with(task: Task, effect: Effect) -> Task:
    strength, *others = effect.searched
    absent = replace(strength, initial=effect.strength.null)
    cell = replace(
        task.cell,
        effects=(*task.cell.effects, effect.entry_name),
        offered={**task.cell.offered, effect.entry_name: tuple(parameter.name for parameter in effect.searched)},
    )
    return replace(task, cell=cell, space=ParameterSpace((*task.space, absent, *others)))
