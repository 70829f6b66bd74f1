"""A cell at equilibrium under a measured current: the open-circuit voltage that belongs to the charge drawn so far."""

from __future__ import annotations

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
from ....core.task import Experiment, Task
from ....core.trajectory import SECONDS_PER_HOUR, FloatArray
from ..augmentation import effects_in, part_of
from ..cells.nameplate import CAPACITY
from ..cells.ocp_shape import keeping_ocp_falling
from ..cells.parameter_sets import load, voltage_window
from ..cells.state_of_charge import InitialState
from ..modelling.compiled_cell import added_potentials, start_of
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
        self._area = {name: float(values[name]) for name in _AREA}
        # A spectrum stays: nothing is said of it.
        self._records = [one.target if one.is_spectrum else _Record(one, values) for one in task.experiments]
        self._capacity_ah = float(values[CAPACITY])
        own = [(effect, part_of(effect)) for effect in self._effects]
        self._at_rest = [(effect, part.at_rest) for effect, part in own if part.at_rest is not None]
        self._current = [(effect, part.current) for effect, part in own if part.current is not None]

    def outcome(self, candidate: Candidate) -> Outcome:
        """What a candidate shows; failed where its electrodes cannot hold the lithium at the start."""
        potentials = added_potentials(self._values, self._effects, candidate) if self._effects else {}
        try:
            runs = [
                self._run(record, candidate, potentials) if isinstance(record, _Record) else ExperimentRun(record)
                for record in self._records
            ]
        except ValueError as error:
            failed = ExperimentRun(None, SimulationFailure(str(error)))
            return Outcome((failed,) * len(self._task.experiments), 0.0)
        return Outcome(tuple(runs), 0.0)

    def _run(self, own: _Record, candidate: Candidate, potentials: Mapping[str, FloatArray]) -> ExperimentRun:
        record, charge_ah = own.measured, own.drawn_ah
        change = self._falling(self._task.space.change(candidate))
        offset = change.current_offset.get(own.start.record, 0.0)
        if self._current or offset:
            charge_ah = drawn_ah(self._through_the_cell(offset_by(own.drive, offset), candidate), record.time)
        drawn = charge_ah * SECONDS_PER_HOUR / _FARADAY / self._area_of(change)
        soc = own.start.soc_of(change, partial(own.state.soc_at, change=change, added=potentials))
        # Beyond these an empty or overfull cell is simulated as such; published potentials reach to -100 V there.
        voltage = np.clip(own.state.voltages(change, soc, drawn, potentials), *own.shown_v)
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


class _Record:
    """A measured current, and what of it is the same for all candidates."""

    def __init__(self, experiment: Experiment, values: Any) -> None:
        self.measured, self.start = experiment.target, start_of(experiment)
        warmed = values.copy()
        self.start.set_temperatures(warmed)
        self.state = InitialState(warmed)
        self.shown_v = shown_range(voltage_window(values), self.measured.voltage)
        self.drive = current_function(self.measured)
        self.drawn_ah = drawn_ah(self.drive, self.measured.time)
