"""A cell driven by one measured current, with or without effects, compiled once and solved for any candidate."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....core.comparison.knees import USUAL_SLOPE
from ....core.contracts.border import border
from ....core.effect import Effect
from ....core.parameters import Candidate
from ....core.target import CellChange, Target
from ....core.task import CellModel
from ....core.trajectory import FloatArray, Trajectory
from ..modelling.compiled_cell import OFFSET, PAUSE, SOLVER_ERRORS, CompiledCell, Start, first_line
from ..modelling.drive import DELAY, EMPTY_V, FULL_V, JUMP_S, current_function, one_after_another, shown_range
from ..modelling.resolution import FINE as UNIFORM_FINE
from ..modelling.resolution import Resolution
from .output_times import output_times

_NEVER = (1e12, 1e12)
"""A pause that never comes, s."""

MAX_STEPS = 30_000
"""Steps after which the integrator gives up."""

_T_NO_PROGRESS_S = 10.0
"""A solve that advances less than this in 400 steps has failed, s."""

_STUCK = 3
"""Times that the limit may be reached again within one pause."""

_FALLEN = 0.9
"""Share of the current at which a cell reached its limit, below which it is tried again with what is measured. The
current of a voltage hold decays: a cell that is full for a moment as the hold begins would else lack all of its charge,
and a parameter that moves that moment by a second would move the misfit by 100 mV. Each trial costs a restart, 28 in a
hold down to a twentieth of its current."""

_FEWEST_SLOPES = 8
"""Slopes of the voltage in a step at least, by which the last one is judged."""

_FROM_LIMIT = Resolution(rtol=1e-4, least_atol=1e-5)
"""Tolerances with which a cell goes on from its limit where its own are too tight: the surfaces of its particles hold
no lithium there, and potentials consistent to 1e-7 may not be found. Voltages differ by less than 0.1 mV."""

_Part = tuple[FloatArray, FloatArray, FloatArray]
"""Time, voltage and temperature of a stretch of a simulation."""

_OUTPUTS = ("Voltage [V]", "Volume-averaged cell temperature [K]")

SEARCH = Resolution(standard_mesh=True).graded()
"""For a discovery, whose base parameters change no length of the mesh."""

FINE = UNIFORM_FINE.graded()
"""Twice the points of that; see `resolution.FINE`."""

_CONSISTENT_START = {"max_num_jacobians_ic": 4}
"""How long potentials that are consistent with a new current are sought: as long as SUNDIALS does of itself. PyBaMM
takes up to 40 Jacobians, and 4 s where there are no such potentials (Marcus kinetics beyond their greatest current). Of
250 draws of the usual priors, 150 with SPMe and 100 with DFN, none came out otherwise."""


def _options_of_drive(finest_s: float) -> dict[str, Any]:
    """Of a current that varies all the time, for an integrator that starts afresh at every knot."""
    return {
        "dt_init": 0.25 * finest_s,
        # Beside the drive too no step may be long, since voltages between steps are interpolated.
        "dt_max": max(10.0, 5.0 * finest_s),
        "t_no_progress": min(_T_NO_PROGRESS_S, 20.0 * finest_s),
    }


@dataclass(frozen=True)
class Pause:
    """A time in which the simulated cell could not follow the measured current: it passed none."""

    # start, end: When it reached its limit, and when the measured current was tried again, s on the record's clock;
    # infinite where the simulation could not go on.
    start: float
    end: float
    step_end: float  # When the step of the record ended, s on its clock.
    empty: bool  # Whether it was empty; else it was full.

    def holds(self, times: FloatArray) -> NDArray[np.bool_]:
        """Which times lie in it."""
        return np.asarray((times > self.start) & (times <= self.end))


@dataclass(frozen=True, eq=False)
class Response:
    """What the cell did at the wanted times, as far as it was simulated."""

    # voltage, temperature: At the terminals, V, and averaged over the volume, K; constant after the end of a simulation
    # that failed. Shape (n,).
    voltage: FloatArray
    temperature: FloatArray
    pauses: tuple[Pause, ...]  # When the cell was empty or full.
    reached: float  # The last simulated time, s on the record's clock.
    cause: str = ""  # Why the integrator gave up; empty if it did not.


class DrivenCell:
    """One record on one cell model, with or without effects.

    ``record``, cut into steps, supplies the current; `on_other` follows those of ``others``. ``targets`` are what a
    candidate sets of the base parameters, by the names that it uses. ``start`` gives the temperatures, and where the
    record begins for `follow`; left out, those of the parameter set. With ``any_start``, `solve` may be told any state
    of charge.
    """

    def __init__(
        self,
        cell: CellModel,
        effects: Sequence[Effect],
        record: Trajectory,
        targets: Mapping[str, Target],
        start: Start | None = None,
        resolution: Resolution = SEARCH,
        baked: CellChange | None = None,
        others: Sequence[Trajectory] = (),
        any_start: bool = True,
    ) -> None:
        self._effects = tuple(effects)
        self._records = (record, *others)
        self._drives = [current_function(one) for one in self._records]
        joined, self._delays = one_after_another(self._drives)
        self._cell = CompiledCell(cell, targets, start or Start(), resolution, baked, effects, joined, any_start)
        self._drive_by(0)
        self.heats = self._cell.heats  # Whether the temperature changes.
        self._model = self._cell.built_model()
        # A near-singular candidate can take minutes without progress and fill the memory with its steps: it has failed.
        options: dict[str, Any] = {
            "max_num_steps": MAX_STEPS,
            "num_steps_no_progress": 400,
            "t_no_progress": _T_NO_PROGRESS_S,
            # Potentials follow the current at once: their error test would cut the steps behind every jump to a
            # hundredth of what concentrations allow. At each step all potentials are solved for anyway.
            "suppress_algebraic_error": True,
        }
        if self._drive.finest_s is not None:
            options |= _options_of_drive(self._drive.finest_s)
        how: dict[str, Any] = {"output_variables": list(_OUTPUTS), "on_failure": "ignore"}
        self._solver = self._cell.solver(options | _CONSISTENT_START, **how)
        self._solver_from_limit = self._cell.solver(options, _FROM_LIMIT, **how)  # compiled when it is first needed

    def _drive_by(self, place: int) -> None:
        self._drive, self._delay_s = self._drives[place], self._delays[place]
        self._stops = self._drive.stops
        self._shown_v = shown_range(self._cell.window_v, self._records[place].voltage)
        self._restarts = np.union1d(self._stops, self._drive.varying)

    def within_limits(self, voltage: FloatArray) -> NDArray[np.bool_]:
        """Which samples show a cell that neither ran empty nor overfull."""
        lowest, highest = self._shown_v
        return np.asarray((voltage > lowest) & (voltage < highest), dtype=np.bool_)

    def on_other(self, place: int) -> DrivenCell:
        """The same compiled cell, driven by the current of one of the other records."""
        other = copy(self)
        other._drive_by(place + 1)
        return other

    def solve(
        self,
        candidate: Candidate,
        times: FloatArray,
        current: FloatArray,
        soc: float | None = None,
        offset: float = 0.0,
    ) -> Response | None:
        """Simulate one candidate as the instruments show it; None if the simulation failed.

        The candidate has a value for every searched parameter and for the effects' parameters. ``times``, s on the
        record's clock, never decrease; ``current`` is what was measured then, A, for effects of the instrument. Both
        have the shape (n,). ``soc`` is the state of charge at the start, 0 to 1 (None keeps the set's own), and
        ``offset`` is added to the measured current, A.
        """
        wanted = times
        for effect in self._effects:
            if effect.measurement is not None and effect.measurement.clock is not None:
                with border(f"effect {effect.key}", "clock"):
                    wanted = effect.measurement.clock(wanted, effect.values(candidate))
        response = self.follow(candidate, wanted, soc, offset)
        if response.cause:
            return None
        voltage = response.voltage
        for effect in self._effects:
            if effect.measurement is not None and effect.measurement.voltage is not None:
                with border(f"effect {effect.key}", "voltage"):
                    voltage = effect.measurement.voltage(voltage, current, effect.values(candidate))
        return replace(response, voltage=voltage) if np.all(np.isfinite(voltage)) else None

    def follow(
        self, candidate: Candidate, times: FloatArray, soc: float | None = None, offset: float = 0.0
    ) -> Response:
        """Simulate the cell itself, whatever it runs into; arguments as for `solve`.

        A candidate that empties (or overfills) its cell before a step ends must say how wrong it is, not fail: it
        shows the limit and passes no current until the measured one has fallen or the step ends, and goes on from
        there. So the error grows steadily with the charge that is lacking, and its slope leads a fit back.
        """
        first, last = float(self._stops[0]), float(self._stops[-1])
        parts: list[_Part] = []
        pauses: list[Pause] = []
        times = np.clip(times, first, last)
        try:
            inputs = self._cell.inputs(candidate, soc) | {OFFSET: offset}
            cause = self._go_through(inputs, times, parts, pauses)
        except ValueError as error:
            cause = first_line(error)
        if not parts:
            nothing = np.full(len(times), np.nan)
            return Response(nothing, nothing, (), first, cause)
        clock, voltage, kelvin = (np.concatenate(series) for series in zip(*parts, strict=True))
        if cause and pauses:
            # A cell at its limit that cannot be simulated on stays there.
            pauses.append(replace(pauses[-1], start=float(clock[-1]), end=np.inf))
            cause = ""
        voltage, kelvin = np.interp(times, clock, voltage), np.interp(times, clock, kelvin)
        for shown in pauses:
            voltage[shown.holds(times)] = EMPTY_V if shown.empty else FULL_V
        voltage = np.clip(voltage, *self._shown_v)
        return Response(voltage, kelvin, tuple(pauses), float(clock[-1]), cause)

    def _go_through(self, inputs: dict[str, float], times: FloatArray, parts: list[_Part], pauses: list[Pause]) -> str:
        """Simulate the record part by part, with a pause after each but the last; why it ended early, if it did."""
        last = float(self._stops[-1])
        state: Any = None
        pause, stuck = _NEVER, 0
        while stuck < _STUCK:
            state, cause = self._advance(state, inputs, pause, times)
            if state is None:
                return cause
            parts.append((state.t, *(np.asarray(state[name].data).ravel() for name in _OUTPUTS)))
            reached = float(state.t[-1])
            at_limit = not cause or self._beyond_cut_off(float(parts[-1][1][-1]))
            if not at_limit and not self._collapses(*parts[-1][:2]):
                return cause
            if reached >= last - JUMP_S:
                return ""
            if reached < pause[1] and pause is not _NEVER:
                stuck += 1
                continue
            step_end = float(self._stops[self._stops > reached + JUMP_S][0])
            is_empty = self._is_empty(reached, float(parts[-1][1][-1]))
            pauses.append(Pause(reached, self._fallen_at(reached, step_end), step_end, is_empty))
            # Already over when the integrator goes on, so that the limit is not reached at once again.
            pause, stuck = (reached - 2 * JUMP_S, pauses[-1].end), 0
        return "the cell is at its limit again as soon as no current passes"

    def _is_empty(self, reached: float, voltage: float) -> bool:
        """Whether a cell at its limit is empty.

        The current tells: potentials beyond the range of their data may let the voltage of an overfull cell collapse.
        In a rest, where none is measured, a leak may have emptied it.
        """
        flowing = self._flowing(reached)
        return flowing > 0.0 if flowing else voltage < float(np.mean(self._cell.window_v))

    def _fallen_at(self, reached: float, step_end: float) -> float:
        """When the current of a hold has fallen from that at which the cell reached its limit; else the step's end."""
        varies = np.any((self._drive.varying > reached) & (self._drive.varying < step_end))
        flowing = self._flowing(reached)
        if varies or flowing == 0.0:
            return step_end
        knots = self._drive.time[(self._drive.time > reached + JUMP_S) & (self._drive.time < step_end)]
        times = np.concatenate([[reached + JUMP_S], knots, [step_end]])
        share = self.current(times, ()) / flowing
        below = int(np.argmax(share < _FALLEN))
        if below == 0:
            return step_end
        return float(np.interp(-_FALLEN, -share[below - 1 : below + 1], times[below - 1 : below + 1]))

    def _beyond_cut_off(self, voltage: float) -> bool:
        """Whether a cell that the integrator gave up on was about to run empty or full: there its voltage collapses."""
        lowest, highest = self._cell.window_v
        return not lowest < voltage < highest

    def _collapses(self, time: FloatArray, voltage: FloatArray) -> bool:
        """Whether the voltage of a cell that the integrator gave up on was on its way to a limit ever faster.

        The integrator may give up within a second of a voltage that is still within the cut-offs. ``time`` and
        ``voltage`` are of the stretch that it solved, shape (n,).
        """
        begin = float(np.max(self._stops[self._stops < time[-1]], initial=self._stops[0]))
        inside = time >= begin
        varies = np.any((self._drive.varying > begin) & (self._drive.varying <= time[-1]))
        # A varying current moves the voltage by itself.
        if varies or np.count_nonzero(inside) <= _FEWEST_SLOPES:
            return False
        towards_limit = -np.diff(voltage[inside]) / np.diff(time[inside]) * np.sign(self._flowing(float(time[-1])))
        return bool(towards_limit[-1] > USUAL_SLOPE * np.median(np.abs(towards_limit)))

    def _flowing(self, time: float) -> float:
        """The measured current just before a time, A."""
        return float(self.current(np.array([time - 2 * JUMP_S]), ())[0])

    def current(self, times: FloatArray, pauses: Sequence[Pause]) -> FloatArray:
        """The current that the cell passed, A, shape (n,)."""
        current = np.interp(times, self._drive.time, self._drive.current)
        for pause in pauses:
            current[pause.holds(times)] = 0.0
        return current

    def _advance(
        self, before: Any, inputs: dict[str, float], pause: tuple[float, float], times: FloatArray
    ) -> tuple[Any, str]:
        """Solve on from a solution (from the start, where it is None) until the record or the cell ends.

        The solution, None if there is none, and why the integrator gave up, empty if it did not.
        """
        start = float(self._stops[0] if before is None else before.t[-1])
        edges = [edge + after for edge in pause for after in (0.0, JUMP_S) if start < edge + after < self._stops[-1]]
        stops = np.unique([start, *self._restarts[self._restarts > start], *edges])
        flows = self.current(0.5 * (stops[1:] + stops[:-1]), ()) != 0.0
        grid = output_times(times[times > start], stops, flows)
        # Stops and samples closer than rounding would make steps of no length.
        stops, grid = (t[np.concatenate([[True], np.diff(t) > 1e-2 * JUMP_S])] for t in (stops, grid))
        inputs = inputs | dict(zip(PAUSE, pause, strict=True)) | {DELAY: self._delay_s}
        found, cause = self._solve(self._solver, before, inputs, stops, grid)
        if before is not None and cause and (found is None or found.t[-1] - start < JUMP_S):
            return self._solve(self._solver_from_limit, before, inputs, stops, grid)
        return found, cause

    def _solve(
        self, solver: Any, before: Any, inputs: dict[str, float], stops: FloatArray, grid: FloatArray
    ) -> tuple[Any, str]:
        """Solve on from a solution, or from the start; what `_advance` gives."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                if before is None:
                    found = solver.solve(self._model, t_eval=stops, t_interp=grid, inputs=inputs)
                else:
                    # PyBaMM does not go on from an event unless it is told that none was met.
                    state = before.last_state
                    state.termination = "final time"
                    clock, wanted = stops - stops[0], grid - stops[0]
                    found = solver.step(
                        state, self._model, clock[-1], t_eval=clock, t_interp=wanted, inputs=inputs, save=False
                    )
        except SOLVER_ERRORS as error:
            return None, first_line(error)
        return found, "the integrator gave up" if found.termination == "failure" else ""
