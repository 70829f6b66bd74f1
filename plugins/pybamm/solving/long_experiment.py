"""An experiment of hundreds of cycles: compiled once, run with nothing kept but the last state and a few curves."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ....core.ageing.cycle_table import COLUMNS
from ....core.ageing.summary import (
    DISCHARGES,
    discharged_ah,
    filled,
    in_sequence,
    line_of,
    resistance_delay_s,
    table_of,
)
from ....core.effect import Effect
from ....core.parameters import Candidate
from ....core.protocol_text import runs_of
from ....core.simulation import ExperimentRun, SimulationFailure
from ....core.target import CellChange, Target
from ....core.task import CellModel, Experiment, Protocol
from ....core.trajectory import FloatArray, Trajectory
from ..cells.parameter_sets import pybamm
from ..modelling.compiled_cell import SOLVER_ERRORS, first_line
from ..modelling.resolution import SEARCH, Resolution
from .compiled import CompiledExperiment
from .cycle_jumps import TOLERANCE, CycleFailed, CycleRunner, SolvedCycle
from .last_moments import last_moments, nearest_limit, solve_step
from .step_solutions import step_kind, to_trajectory

_COMPILED_REPEATS = 2
"""Of equal cycles so many are compiled, so that the way from the last step of one to the first of the next is there."""

_LOSS_VARIABLES = (
    "Loss of lithium inventory [%]",
    "Loss of active material in negative electrode [%]",
    "Loss of active material in positive electrode [%]",
)


class _Failed(CycleFailed):
    """A cycle that stopped early, with what it reached."""

    def __init__(self, failure: SimulationFailure, record: Trajectory | None) -> None:
        super().__init__(failure.cause)
        self.failure, self.record = failure, record


class LongExperiment:
    """A long experiment, ready to be simulated for many candidates without a rebuild; see `CompiledExperiment`.

    The curves of the experiment's detailed cycles are kept. Resistances are read as long after the switch as the
    measured ones, for diffusion adds percents to them within a second. With ``leave_out``, cycles in which the cell
    changes steadily are left out (`CycleRunner`).
    """

    def __init__(
        self,
        cell: CellModel,
        experiment: Experiment,
        targets: Mapping[str, Target],
        resolution: Resolution = SEARCH,
        baked: CellChange | None = None,
        leave_out: bool = True,
        effects: Sequence[Effect] = (),
    ) -> None:
        assert experiment.protocol is not None
        self._kept = frozenset(experiment.detailed_cycles)
        self._runs: list[tuple[int, int]] = []  # Place of a cycle among the compiled ones, and how many are like it.
        short: Protocol = ()
        for count, cycle in runs_of(experiment.protocol):
            self._runs.append((len(short), count))
            short += (cycle,) * min(count, _COMPILED_REPEATS)
        self._tolerance = TOLERANCE if leave_out else None
        self._delay_s = resistance_delay_s(experiment.target)
        self._compiled = CompiledExperiment(
            cell, replace(experiment, protocol=short), targets, resolution, baked, effects
        )

    def solve(self, candidate: Candidate, on_step: Callable[[str, int], None] | None = None) -> ExperimentRun:
        """Simulate one candidate; see `CompiledExperiment.solve`."""
        try:
            inputs = self._compiled.cell.inputs(candidate)
            self._compiled.simulation.build_for_experiment(inputs=inputs)
        except SOLVER_ERRORS as error:
            return ExperimentRun(None, SimulationFailure(first_line(error)))
        life = _Life(self._kept)
        runner = CycleRunner(_restated, pybamm.EmptySolution(), self._tolerance)
        number = 1
        try:
            for place, count in self._runs:
                steps = _Steps(self._compiled, place, inputs, on_step, self._delay_s)
                for cycle in runner.run(steps.simulate, number, number + count - 1, self._kept):
                    life.add(cycle)
                life.close_gaps()
                number += count
        except _Failed as stopped:
            life.close_gaps()
            if stopped.record is not None:
                life.curves[stopped.failure.cycle] = stopped.record
            reached = replace(stopped.failure, reached_s=life.seconds + stopped.failure.reached_s)
            return ExperimentRun(life.record(), reached)
        return ExperimentRun(life.record())


class _Life:
    """What is kept of the cycles that were simulated."""

    def __init__(self, kept: frozenset[int]) -> None:
        self._kept = kept
        self._lines: list[tuple[float, ...]] = []
        self._run: list[tuple[float, ...]] = []
        self.curves: dict[int, Trajectory] = {}
        self.seconds = 0.0

    def add(self, cycle: SolvedCycle) -> None:
        """Take note of a simulated cycle."""
        self._run.append(line_of(cycle.number, cycle.record, cycle.losses, cycle.first_v))
        before = self._run[-2][0] if len(self._run) > 1 else cycle.number - 1
        self.seconds += cycle.record.duration * (cycle.number - before)
        if cycle.number in self._kept:
            self.curves[cycle.number] = cycle.record

    def close_gaps(self) -> None:
        """Fill in the lines of the cycles left out since the last call."""
        table = table_of(self._run)
        if table is not None:
            table = filled(table)
            self._lines += zip(table.cycle, *(getattr(table, name) for name in COLUMNS), strict=True)
        self._run = []

    def record(self) -> Trajectory | None:
        """The kept curves with the cycle table; None without a curve."""
        return in_sequence(sorted(self.curves.items()), table_of(self._lines)) if self.curves else None


class _Steps:
    """The compiled steps of one kind of cycle."""

    def __init__(
        self,
        compiled: CompiledExperiment,
        place: int,
        inputs: dict[str, float],
        on_step: Callable[[str, int], None] | None,
        delay_s: float,
    ) -> None:
        self._compiled, self._inputs, self._on_step, self._delay_s = compiled, inputs, on_step, delay_s
        self._recipe = compiled.steps[place]
        before = sum(len(cycle) for cycle in compiled.steps[:place])
        self._steps = compiled.simulation.experiment.steps[before : before + len(self._recipe)]
        kinds = [step_kind(step) for step in self._steps]
        self._first = next((place for place, kind in enumerate(kinds) if kind in DISCHARGES), None)

    def simulate(self, number: int, state: Any) -> SolvedCycle:
        """One cycle from a state.

        Raises `CycleFailed` if a step cannot be solved, or ends otherwise than the protocol says.
        """
        parts: list[Any] = []
        first_v = float("nan")
        for position, step in enumerate(self._steps):
            if self._on_step:
                self._on_step(str(step), number)
            if position == self._first and self._delay_s > 0.0:
                first_v = self._soon(step, state)
            try:
                part = self._step(step, state)
            except SOLVER_ERRORS as error:
                part, limit = None, ""
                if not isinstance(state, pybamm.EmptySolution):
                    window_v = self._compiled.cell.window_v
                    part, limit = last_moments(self._compiled.simulation, state, step, self._inputs, window_v)
                raise self._stopped(first_line(error), number, position, parts, limit, part) from None
            parts.append(part)
            if isinstance(part, pybamm.EmptySolution):
                continue
            state = part.last_state
            # A state that ended by an event would be handed back unsolved, as if the cell were at its limit.
            state.termination = "final time"
            if part.termination == "final time" and step.uses_default_duration:
                cause = "the step did not reach its end condition within its longest duration"
            elif part.termination != "final time" and "[experiment]" not in part.termination:
                cause = str(part.termination)
            else:
                continue
            limit = nearest_limit(part, self._compiled.cell.window_v)
            raise self._stopped(cause, number, position, parts, limit)
        record = self._record(parts)
        if record is None:
            raise self._stopped("every step of the cycle ends before it begins", number, 0, parts, "")
        return SolvedCycle(number, state, _vector(state), discharged_ah(record), record, _losses(state), first_v)

    def _step(self, step: Any, state: Any) -> Any:
        try:
            return solve_step(self._compiled.simulation, state, step, step.duration, self._inputs)
        except pybamm.SolverError as error:
            if "non-positive at initial conditions" in str(error) and "[experiment]" in str(error):
                return pybamm.EmptySolution("Event exceeded in initial conditions", t=float(state.t[-1]))
            raise

    def _soon(self, step: Any, state: Any) -> float:
        """The voltage where a resistance is read after a step sets in, V; NaN if the step cannot be solved so far."""
        try:
            part = solve_step(self._compiled.simulation, state, step, self._delay_s, self._inputs)
            return float(part["Voltage [V]"].entries[-1])
        except SOLVER_ERRORS:
            return float("nan")

    def _stopped(
        self, cause: str, number: int, position: int, parts: list[Any], limit: str, unfinished: Any = None
    ) -> _Failed:
        """The failure in a step; ``unfinished`` is what of it could be solved where the integrator gave up."""
        record = self._record(parts, unfinished)
        failure = SimulationFailure(
            cause,
            str(self._steps[position]),
            number,
            0.0 if record is None else record.duration,
            limit,
            # A step that took too long, or ended by a foreign event, is part of the solution.
            unfinished is not None or len(parts) > position,
        )
        return _Failed(failure, record)

    def _record(self, parts: list[Any], unfinished: Any = None) -> Trajectory | None:
        solved = [(1, position, part) for position, part in enumerate(parts)]
        cut = None if unfinished is None else (1, len(parts), unfinished)
        return to_trajectory(solved, [self._recipe], self._compiled.cell.heats, cut)


def _losses(state: Any) -> tuple[float, ...]:
    """Lithium and active material lost, in the order of `LOSSES`."""
    return tuple(float(state[name].entries[-1]) for name in _LOSS_VARIABLES)


def _vector(state: Any) -> FloatArray:
    return np.array(state.all_ys[-1], dtype=np.float64)[:, -1]


def _restated(state: Any, vector: FloatArray) -> Any:
    """A state of PyBaMM with other numbers; the algebraic ones among them are made consistent by the next step."""
    return pybamm.Solution(
        state.t[-1:], vector[:, np.newaxis], state.all_models[-1], state.all_inputs[-1], termination="final time"
    )
