"""A cell at equilibrium under a measured current: the open-circuit voltage that belongs to the charge drawn so far."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.constants import physical_constants

from ....core.contracts.border import border
from ....core.parameters import Candidate
from ....core.simulation import ExperimentRun, Outcome, SimulationFailure
from ....core.target import CellChange
from ....core.task import Task
from ....core.trajectory import SECONDS_PER_HOUR, FloatArray
from ..augmentation import effects_in, part_of
from ..cells.nameplate import CAPACITY
from ..cells.ocp_shape import keeping_ocp_falling
from ..cells.parameter_sets import load, voltage_window
from ..cells.state_of_charge import InitialState
from ..modelling.compiled_cell import Start, added_potentials, start_of
from ..modelling.drive import CurrentFunction, current_function, drawn_ah, offset_by, shown_range

_AREA = ("Electrode width [m]", "Electrode height [m]", "Number of electrodes connected in parallel to make a cell")
_FARADAY = physical_constants["Faraday constant"][0]


class EquilibriumCell:
    """The open-circuit voltage of a task's cell along its measured currents, without a solver.

    Both electrodes are homogeneous: :math:`V = U_p(y_0 + q / Q_p) - U_n(x_0 - q / Q_n)` with the charge :math:`q` drawn
    since the start, that of the driven cell, and the electrodes' capacities :math:`Q` (Mohtat et al., J. Power Sources
    427 (2019) 101, Eqs. 1 to 5). Its temperature stays that of the start; resistances and the time that diffusion takes
    have no part in it.
    """

    def __init__(self, task: Task) -> None:
        self._task, self._targets = task, task.space.targets
        values = load(task.cell.parameter_set, task.cell.overrides)
        self._falling = keeping_ocp_falling(values, self._targets)
        self._values, self._effects = values, effects_in(task.cell)
        self._starts = [start_of(experiment) for experiment in task.experiments]
        self._states = [_state_at(start, values) for start in self._starts]
        self._area = {name: float(values[name]) for name in _AREA}
        self._records = [experiment.target for experiment in task.experiments]
        window_v = voltage_window(values)
        self._shown_v = [
            None if one.is_spectrum else shown_range(window_v, one.target.voltage) for one in task.experiments
        ]
        self._drives = [None if one.is_spectrum else current_function(one.target) for one in task.experiments]
        self._drawn_ah = [
            None if drive is None else drawn_ah(drive, record.time)
            for drive, record in zip(self._drives, self._records, strict=True)
        ]
        self._capacity_ah = float(values[CAPACITY])
        own = [(effect, part_of(effect)) for effect in self._effects]
        self._at_rest = [(effect, part.at_rest) for effect, part in own if part.at_rest is not None]
        self._current = [(effect, part.current) for effect, part in own if part.current is not None]

    def outcome(self, candidate: Candidate) -> Outcome:
        """What a candidate shows; failed where its electrodes cannot hold the lithium at the start."""
        potentials = added_potentials(self._values, self._effects, candidate) if self._effects else {}
        try:
            runs = [self._run(place, candidate, potentials) for place in range(len(self._task.experiments))]
        except ValueError as error:
            failed = ExperimentRun(None, SimulationFailure(str(error)))
            return Outcome((failed,) * len(self._task.experiments), 0.0)
        return Outcome(tuple(runs), 0.0)

    def _run(self, place: int, candidate: Candidate, potentials: Mapping[str, FloatArray]) -> ExperimentRun:
        record, drive, shown_v = self._records[place], self._drives[place], self._shown_v[place]
        charge_ah = self._drawn_ah[place]
        if charge_ah is None or drive is None or shown_v is None:
            return ExperimentRun(record)  # A spectrum stays: nothing is said of it.
        change = self._falling(self._task.space.change(candidate))
        offset = change.current_offset.get(self._task.experiments[place].name, 0.0)
        if self._current or offset:
            charge_ah = drawn_ah(self._through_the_cell(offset_by(drive, offset), candidate), record.time)
        drawn = charge_ah * SECONDS_PER_HOUR / _FARADAY / self._area_of(change)
        state = self._states[place]
        soc = self._starts[place].soc_of(change, partial(state.soc_at, change=change, added=potentials))
        # Beyond these an empty or overfull cell is simulated as such; published potentials reach to -100 V there.
        voltage = np.clip(state.voltages(change, soc, drawn, potentials), *shown_v)
        for effect, added in self._at_rest:
            with border(f"effect {effect.key}", "at_rest"):
                voltage = voltage + added(record.current, charge_ah, self._capacity_ah, effect.values(candidate))
        # The measured temperature stays: nothing is said of it.
        return ExperimentRun(record.changed(record.time - record.time[0], voltage=voltage))

    def _through_the_cell(self, drive: CurrentFunction, candidate: Candidate) -> CurrentFunction:
        """The current that the effects make of the measured one."""
        current = drive.current
        for effect, changed in self._current:
            with border(f"effect {effect.key}", "current"):
                current = changed(current, effect.values(candidate))
        return replace(drive, current=current)

    def _area_of(self, change: CellChange) -> float:
        own = (change.values.get(name, value) * change.factors.get(name, 1.0) for name, value in self._area.items())
        return math.prod(own)


def _state_at(start: Start, values: Any) -> InitialState:
    """The electrodes of a parameter set at the temperature at which a record starts."""
    warmed = values.copy()
    start.set_temperatures(warmed)
    return InitialState(warmed)
