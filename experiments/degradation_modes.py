"""Loss of lithium and of active material over a life, from the curves of its cycles alone: no mechanism is assumed."""

from collections.abc import Mapping, Sequence

from ..core.contracts.requests import Answering, LifeRequest, LifeResiduals
from ..core.inference.drift import Drift, drifts
from ..core.parameters import Candidate, Parameter, ParameterSpace
from ..core.target import CYCLABLE_LITHIUM, change_of, target_named
from ..core.task import Task
from ..core.trajectory import FloatArray
from ..plugins.pybamm.cells.ocp_shape import ELECTRODES
from ..plugins.pybamm.cells.parameter_sets import load
from ..plugins.pybamm.cells.state_of_charge import InitialState
from .tasks.measured_cell import RESISTANCE

LITHIUM = "Loss of lithium inventory [%]"

_SPREAD, _LEAST, _MOST = 0.1, 0.3, 1.3
"""Prior standard deviation of the logarithm of lithium and active material, and their bounds: a cell is
discarded when it has lost a fifth."""

_VOLTS_AT_1C = 0.05
"""Standard deviation of the resistance, as the voltage that it loses at 1C."""

_DIFFERENCE = 0.05


def _material(which: str) -> str:
    return f"{which} electrode active material volume fraction"


_OF_THE_CELL = (*map(_material, ELECTRODES), RESISTANCE)
"""What drifts of the cell's own parameters."""


def lost_material(which: str) -> str:
    """What the loss of an electrode's material is called."""
    return f"Loss of active material in {which.lower()} electrode [%]"


def degradation_modes(task: Task, cell: Candidate, simulator: Answering[LifeRequest, LifeResiduals]) -> list[Drift]:
    """Lithium, active material and contact resistance, fitted to each cycle of a life whose curves are kept.

    ``task`` is the life of a cell that does not age, ``cell`` its parameters when it was new; ``simulator`` simulates
    single cycles of that life. Gives what drifts from the second kept cycle on, before which the cell had not settled;
    losses are since that cycle.
    """
    (experiment,) = task.experiments
    values = load(task.cell.parameter_set, task.cell.overrides)
    space = _space(task, {**{name: float(values.get(name, 0.0)) for name in _OF_THE_CELL}, **cell})
    drifting = {name: target_named(name) for name in space.names}
    targets = drifting | task.space.targets

    def simulate(cycle: int, candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        found = simulator.predict([LifeRequest((), {**cell, **candidate}, cycle) for candidate in candidates])
        return [None if one is None else one.residual for one in found]

    state = InitialState(values)
    new = state.inventory(change_of(targets, {**space.initial, **cell}))

    def quantities(candidate: Candidate) -> Mapping[str, float]:
        left = state.inventory(change_of(targets, {**cell, **candidate}))
        lost = {name: 100.0 * (1.0 - left[name] / new[name]) for name in new}
        losses = {LITHIUM: lost["lithium"], **{lost_material(which): lost[which] for which in ELECTRODES}}
        return {**losses, RESISTANCE: candidate[RESISTANCE]}

    return drifts(simulate, experiment.target.cycles[1:], space, quantities)


def _space(task: Task, cell: Candidate) -> ParameterSpace:
    table = task.experiments[0].target.cycle_table
    assert table is not None
    ohm = cell[RESISTANCE]
    at_1c = _VOLTS_AT_1C / float(table.capacity_ah[0])
    shares = {CYCLABLE_LITHIUM: 1.0, **{_material(which): cell[_material(which)] for which in ELECTRODES}}
    return ParameterSpace(
        (
            *(
                Parameter(name, value, _LEAST * value, _MOST * value, "log", None, _SPREAD, True, _DIFFERENCE)
                for name, value in shares.items()
            ),
            Parameter(RESISTANCE, ohm, 0.0, ohm + 10 * at_1c, "linear", None, at_1c, True, _DIFFERENCE),
        )
    )
