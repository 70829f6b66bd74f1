"""Loss of lithium and of active material over a life, from the curves of its cycles alone: no mechanism is assumed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..core.ageing.summary import in_sequence
from ..core.discovery.drift import Drift, drifts
from ..core.parameters import Candidate, Parameter, ParameterSpace
from ..core.residuals import residuals
from ..core.simulation import Outcome
from ..core.target import CYCLABLE_LITHIUM, CyclableLithium, change_of
from ..core.task import Task
from ..core.trajectory import FloatArray
from ..plugins.pybamm.long_experiment import LongExperiment
from ..plugins.pybamm.ocp_shape import ELECTRODES
from ..plugins.pybamm.parameter_sets import load
from ..plugins.pybamm.state_of_charge import InitialState
from .tasks.records import RESISTANCE

LITHIUM = "Loss of lithium inventory [%]"

_SPREAD, _LEAST, _MOST = 0.1, 0.3, 1.3
"""Standard deviation of the logarithm that is believed of lithium and active material, and their bounds: a cell is
discarded when it has lost a fifth."""

_VOLTS_AT_1C = 0.05
"""Standard deviation of the resistance, as the voltage that it loses at 1C."""

_DIFFERENCE = 0.05


def _material(which: str) -> str:
    return f"{which} electrode active material volume fraction"


def lost_material(which: str) -> str:
    """What the loss of an electrode's material is called."""
    return f"Loss of active material in {which.lower()} electrode [%]"


def degradation_modes(task: Task, cell: Candidate) -> list[Drift]:
    """Lithium, active material and contact resistance, fitted to each cycle of a life whose curves are kept.

    Parameters
    ----------
    task : Task
        The life, of a cell that does not age.
    cell : Candidate
        Its parameters when it was new.

    Returns
    -------
    list of Drift
        From the second kept cycle on, before which the cell had not settled; losses are since that cycle.
    """
    (experiment,) = task.experiments
    targets = {**task.space.targets, CYCLABLE_LITHIUM: CyclableLithium()}
    assert experiment.protocol is not None
    # The cycle before brings the cell to where the window begins.
    windows = {
        number: replace(
            task,
            experiments=(
                replace(
                    experiment,
                    target=in_sequence([(2, experiment.target.cycle(number))]),
                    protocol=experiment.protocol[:1] * 2,
                    detailed_cycles=(),
                    scored_cycle=2,
                ),
            ),
        )
        for number in experiment.target.cycles[1:]
    }
    (window,) = next(iter(windows.values())).experiments
    compiled = LongExperiment(task.cell, replace(window, detailed_cycles=(2,)), targets)

    def simulate(cycle: int, candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        runs = [compiled.solve({**cell, CYCLABLE_LITHIUM: 1.0, **candidate}) for candidate in candidates]
        return [residuals(windows[cycle], Outcome((run,))) for run in runs]

    state = InitialState(load(task.cell.parameter_set, task.cell.overrides))
    new = state.inventory(change_of(targets, cell))

    def quantities(candidate: Candidate) -> Mapping[str, float]:
        left = state.inventory(change_of(targets, {**cell, **candidate}))
        lost = {name: 100.0 * (1.0 - left[name] / new[name]) for name in new}
        losses = {LITHIUM: lost["lithium"], **{lost_material(which): lost[which] for which in ELECTRODES}}
        return {**losses, RESISTANCE: candidate[RESISTANCE]}

    return drifts(simulate, list(windows), _space(task, cell), quantities)


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
