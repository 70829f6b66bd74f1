"""A cell with effects, driven by one measured current, compiled once and solved for any candidate."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.border import border
from ...core.effect import Effect
from ...core.errors import BsaError
from ...core.parameters import Candidate
from ...core.target import Target, change_of
from ...core.task import CellModel
from ...core.trajectory import FloatArray, Trajectory
from .augmentation import PyBaMMPart, augmented_cell, part_of
from .compiled import make_model
from .drive import JUMP_S, current_function, widen_cut_offs
from .ocp_shape import keeping_ocp_falling
from .parameter_sets import input_values, load, open_to_search, pybamm
from .state_of_charge import InitialState, initial_concentration

_LONGEST_SOLVE_STEPS = 30_000

_EMPTY_V, _FULL_V = 0.5, 6.0
"""What an empty and an overfull cell show until the current changes: the widened cut-offs."""

_NEVER = (1e12, 1e12)
"""A pause that never comes, s."""

_STUCK = 3
"""Times that the limit may be reached again within one pause."""


@dataclass(frozen=True)
class Resolution:
    """Mesh and tolerances.

    Attributes
    ----------
    rtol : float
        Relative tolerance; the absolute one is a tenth of it.
    points : int or None
        Mesh points in every domain; None keeps PyBaMM's own.
    radial_points : int or None
        Mesh points in a particle, where it needs others.
    """

    rtol: float = 1e-5
    points: int | None = None
    radial_points: int | None = None

    def mesh(self) -> dict[str, int]:
        """Mesh points by the name of the coordinate, as PyBaMM's ``var_pts`` has them."""
        radial = self.radial_points or self.points
        chosen = {"x_n": self.points, "x_s": self.points, "x_p": self.points, "r_n": radial, "r_p": radial}
        return {name: count for name, count in chosen.items() if count is not None}


SEARCH = Resolution()
FINE = Resolution(rtol=1e-7, points=40)


@dataclass(frozen=True, eq=False)
class Curve:
    """What the cell did at the wanted times.

    Attributes
    ----------
    voltage : ndarray of shape (n,)
        Volt, as the instrument writes it down.
    temperature : ndarray of shape (n,)
        Volume-averaged temperature, kelvin.
    """

    voltage: FloatArray
    temperature: FloatArray


def within_limits(voltage: FloatArray) -> NDArray[np.bool_]:
    """Which samples show a cell that neither ran empty nor overfull."""
    return np.asarray((voltage > _EMPTY_V) & (voltage < _FULL_V), dtype=np.bool_)


class DrivenCell:
    """One record on one augmented model.

    Parameters
    ----------
    cell : CellModel
        Base equations and parameters.
    effects : sequence of Effect
        What is added.
    record : Trajectory
        Supplies the current; cut into steps.
    targets : mapping of str to Target
        What a candidate sets of the base parameters, by the names that it uses.
    temperature_k : float or None
        Ambient and initial temperature; None keeps the set's.
    resolution : Resolution
        Mesh and tolerances.
    """

    def __init__(
        self,
        cell: CellModel,
        effects: Sequence[Effect],
        record: Trajectory,
        targets: Mapping[str, Target],
        temperature_k: float | None = None,
        resolution: Resolution = SEARCH,
    ) -> None:
        self._effects = tuple(effects)
        self._targets = dict(targets)
        augmented = augmented_cell(cell, effects)
        model = make_model(_with_averaged_reactions(augmented))
        values = load(cell.parameter_set, cell.overrides)
        if temperature_k is not None:
            values.update({"Ambient temperature [K]": temperature_k, "Initial temperature [K]": temperature_k})
        widen_cut_offs(values)
        self._feasible = keeping_ocp_falling(values, self._targets)
        open_to_search(values, self._targets)
        self._initial = InitialState(load(cell.parameter_set, cell.overrides))
        symbols = [
            {p.name: pybamm.InputParameter(effect.full_name(p)) for p in effect.parameters} for effect in effects
        ]
        drive = current_function(record)
        self._stops, self._drive = drive.stops, drive
        current: Any = pybamm.Interpolant(drive.time, drive.current, pybamm.t, interpolator="linear")
        for effect, p in zip(effects, symbols, strict=True):
            current = add_values(values, part_of(effect), p, current)
        values["Current function [A]"] = current * _gate()
        for which in ("negative", "positive"):
            values[initial_concentration(which)] = "[input]"
        for effect, p in zip(effects, symbols, strict=True):
            add_voltage(model, part_of(effect), p)
        points = resolution.mesh()
        for effect in effects:
            points.update(part_of(effect).points)
        # A near-singular candidate can spin for minutes and fill the memory with its steps: one that crawls has failed.
        options: dict[str, Any] = {
            "max_num_steps": _LONGEST_SOLVE_STEPS,
            "num_steps_no_progress": 400,
            "t_no_progress": 10.0,
            "silence_sundials_errors": True,
        }
        if drive.finest_s is not None:
            # The integrator must not step over what the record resolves.
            options["dt_max"] = max(10.0, 5.0 * drive.finest_s)
        try:
            simulation = pybamm.Simulation(
                model,
                parameter_values=values,
                var_pts={**model.default_var_pts, **points},
            )
            simulation.build()
        except (KeyError, pybamm.ModelError, pybamm.OptionError, pybamm.DomainError) as error:
            names = ", ".join(effect.key for effect in effects) or "no effect"
            reason = str(error).strip().splitlines()
            raise BsaError(
                f"PyBaMM cannot build {augmented.model} with {names}: {reason[0] if reason else error!r}.",
                "the parameter set may lack what the effect needs.",
            ) from None
        self._model = simulation.built_model
        self._solver = pybamm.IDAKLUSolver(
            rtol=resolution.rtol,
            atol=0.1 * resolution.rtol,
            output_variables=list(_OUTPUTS),
            options=options,
        )

    def solve(
        self, candidate: Candidate, times: FloatArray, current: FloatArray, soc: float | None = None
    ) -> Curve | None:
        """Simulate one candidate.

        Parameters
        ----------
        candidate : Candidate
            A value for every searched parameter and for the effects' parameters.
        times : ndarray of shape (n,)
            When the voltage is wanted, on the record's clock, s, never decreasing.
        current : ndarray of shape (n,)
            The measured current then, for effects of the instrument, A.
        soc : float or None
            State of charge at the start, 0 to 1; None keeps the set's own.

        Returns
        -------
        Curve or None
            None if the simulation failed.
        """
        wanted = times
        for effect in self._effects:
            if effect.measurement is not None and effect.measurement.clock is not None:
                with border(f"effect {effect.key}", "clock"):
                    wanted = effect.measurement.clock(wanted, effect.values(candidate))
        inside = np.clip(wanted, self._stops[0], self._stops[-1])
        change = self._feasible(change_of(self._targets, candidate))
        inputs = input_values(self._targets, change)
        for effect in self._effects:
            inputs.update({effect.full_name(p): effect.values(candidate)[p.name] for p in effect.parameters})
        try:
            inputs |= self._initial.concentrations(change, soc)
        except ValueError:
            return None
        solved = self._through_pauses(inputs, inside)
        if solved is None:
            return None
        voltage, temperature = solved
        for effect in self._effects:
            if effect.measurement is not None and effect.measurement.voltage is not None:
                with border(f"effect {effect.key}", "voltage"):
                    voltage = effect.measurement.voltage(voltage, current, effect.values(candidate))
        return Curve(voltage, temperature) if np.all(np.isfinite(voltage)) else None

    def _through_pauses(self, inputs: dict[str, float], times: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Voltage and temperature at the wanted times, whatever the cell runs into; None if the solver fails.

        A candidate that empties (or overfills) its cell before a step ends must say how wrong it is, not fail: it
        shows the limit and passes no current until the step ends, and goes on from there. So the error grows
        steadily with the charge that is lacking, and a fit finds its way back.
        """
        last = float(self._stops[-1])
        parts: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        shown: list[tuple[float, float, float]] = []
        state = self._advance(None, inputs, _NEVER, times)
        pause, stuck = _NEVER, 0
        if state is None:
            return None
        while True:
            parts.append((state.t, *(np.asarray(state[name].data).ravel() for name in _OUTPUTS)))
            reached = float(state.t[-1])
            if reached >= last - JUMP_S:
                break
            if reached < pause[1] and pause is not _NEVER:
                stuck += 1
            else:
                drawn = float(np.interp(reached, self._drive.time, self._drive.current))
                step_end = float(self._stops[self._stops > reached + JUMP_S][0])
                shown.append((reached, step_end, _EMPTY_V if drawn > 0 else _FULL_V))
                # Already over when the integrator goes on, so that the limit is not reached at once again.
                pause, stuck = (reached - 2 * JUMP_S, step_end), 0
            state = self._advance(state, inputs, pause, times) if stuck < _STUCK else None
            if state is None:
                shown.append((reached, np.inf, shown[-1][2]))
                break
        clock, voltage, kelvin = (np.concatenate(series) for series in zip(*parts, strict=True))
        voltage, kelvin = np.interp(times, clock, voltage), np.interp(times, clock, kelvin)
        for start, end, limit in shown:
            voltage[(times > start) & (times <= end)] = limit
        return voltage, kelvin

    def _advance(
        self, before: Any, inputs: dict[str, float], pause: tuple[float, float], times: FloatArray
    ) -> Any | None:
        """Solve on from a solution (from the start, where it is None) until the record or the cell ends."""
        start = float(self._stops[0] if before is None else before.t[-1])
        edges = [edge + after for edge in pause for after in (0.0, JUMP_S) if start < edge + after < self._stops[-1]]
        stops = np.unique([start, *self._stops[self._stops > start], *edges])
        grid = np.unique(np.concatenate([times[times > start], stops]))
        # Stops and samples closer than rounding would make steps of no length.
        stops, grid = (t[np.concatenate([[True], np.diff(t) > 1e-2 * JUMP_S])] for t in (stops, grid))
        inputs = inputs | dict(zip(_PAUSE, pause, strict=True))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                if before is None:
                    return self._solver.solve(self._model, t_eval=stops, t_interp=grid, inputs=inputs)
                # PyBaMM does not go on from an event unless it is told that none was met.
                state = before.last_state
                state.termination = "final time"
                clock, wanted = stops - start, grid - start
                return self._solver.step(
                    state, self._model, clock[-1], t_eval=clock, t_interp=wanted, inputs=inputs, save=False
                )
        except (pybamm.SolverError, ValueError, ArithmeticError, RuntimeError):
            return None


_OUTPUTS = ("Voltage [V]", "Volume-averaged cell temperature [K]")
_PAUSE = ("Pause begins [s]", "Pause ends [s]")


def _gate() -> Any:
    """1, and 0 during a pause, as a function of time and inputs."""

    def rise(begin: Any) -> Any:
        return pybamm.minimum(pybamm.maximum((pybamm.t - begin) / JUMP_S, 0), 1)

    start, end = (pybamm.InputParameter(name) for name in _PAUSE)
    return 1 - rise(start) + rise(end)


def _with_averaged_reactions(cell: CellModel) -> CellModel:
    """The same with one SEI and one plated layer where an electrode is one particle: half as fast again, 0.1 mV off."""
    option = "x-average side reactions"
    if (
        cell.model not in ("SPM", "SPMe")
        or option in cell.options
        or not {"SEI", "lithium plating"} & set(cell.options)
    ):
        return cell
    return replace(cell, options={**cell.options, option: "true"})


def add_values(values: Any, part: PyBaMMPart, p: Mapping[str, Any], current: Any) -> Any:
    """Put an effect's parameter values into a set, in place, and return the current it makes of the given one."""
    for name, value in part.borrowed.items():
        if name not in values:
            values.update({name: value}, check_already_exists=False)
    if part.values is not None:
        values.update(dict(part.values(values, p)), check_already_exists=False)
    return part.current(current, p) if part.current is not None else current


def add_voltage(model: Any, part: PyBaMMPart, p: Mapping[str, Any]) -> None:
    """Add an effect's term to the terminal voltage of a model, in place."""
    if part.voltage is not None:
        model.variables["Voltage [V]"] = model.variables["Voltage [V]"] + part.voltage(model, p)
