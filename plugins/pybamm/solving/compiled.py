"""A protocol on one cell model, compiled once and solved for any candidate."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ....core.effect import Effect
from ....core.parameters import Candidate
from ....core.simulation import ExperimentRun, SimulationFailure
from ....core.target import CellChange, Target
from ....core.task import CellModel, Experiment
from ....core.trajectory import Trajectory
from ..augmentation import refuse_current_effects
from ..cells.parameter_sets import pybamm
from ..modelling import drive
from ..modelling.compiled_cell import SOLVER_ERRORS, CompiledCell, first_line, start_of
from ..modelling.resolution import SEARCH, Resolution
from .last_moments import last_moments, nearest_limit
from .step_solutions import Part, keep_solver_steps_of_holds, to_trajectory

MAX_STEPS = 20_000
"""Steps after which the integrator gives up."""


class CompiledExperiment:
    """A protocol, ready to be simulated for many candidates without a rebuild.

    The arguments are those of `CompiledCell`.
    """

    def __init__(
        self,
        cell: CellModel,
        experiment: Experiment,
        targets: Mapping[str, Target],
        resolution: Resolution = SEARCH,
        baked: CellChange | None = None,
        effects: Sequence[Effect] = (),
    ) -> None:
        assert experiment.protocol is not None
        refuse_current_effects(cell)
        self.cell = CompiledCell(cell, targets, start_of(experiment), resolution, baked, effects)
        self.steps = drive.steps_of_protocol(experiment.protocol)
        # A near-singular candidate can take minutes without progress: a sound solve advances faster than this even
        # while it settles after a jump of the current.
        options = {"max_num_steps": MAX_STEPS, "num_steps_no_progress": 200, "t_no_progress": 1e-2}
        self.simulation = self.cell.simulation(
            self.cell.solver(options),
            experiment=pybamm.Experiment([tuple(cycle) for cycle in self.steps], period="30 seconds"),
            experiment_model_mode="legacy",
        )
        keep_solver_steps_of_holds(self.simulation.experiment)

    def solve(self, candidate: Candidate, on_step: Callable[[str, int], None] | None = None) -> ExperimentRun:
        """Simulate one candidate; with the partial trajectory and the failed step if it did not finish.

        ``on_step`` is called with the step's words and its cycle before each step, so that a watcher knows where a hang
        began.
        """
        watcher = _Watcher(on_step)
        cause = ""
        self.simulation._solution = None  # a failed solve must not show its predecessor's result
        try:
            inputs = self.cell.inputs(candidate)
            self.simulation.solve(inputs=inputs, calc_esoh=False, callbacks=[watcher], showprogress=False)
        except SOLVER_ERRORS as error:
            cause = first_line(error)
        cause = watcher.cause or cause
        if cause:
            return self._failed(cause, watcher, inputs if watcher.step else {})
        trajectory = self._trajectory(watcher)
        if trajectory is None:
            return ExperimentRun(None, SimulationFailure("every step of the protocol had reached its end at its start"))
        return ExperimentRun(trajectory)

    def _failed(self, cause: str, watcher: _Watcher, inputs: dict[str, float]) -> ExperimentRun:
        """What was reached, the last moments of the step it died in included."""
        solution = self.simulation._solution
        unfinished: Part | None = None
        limit, cut = "", False
        # One that only skipped steps has no state.
        if isinstance(solution, pybamm.Solution):
            if watcher.gave_up:
                place = sum(len(cycle) for cycle in self.steps[: watcher.cycle - 1]) + watcher.position
                step = self.simulation.experiment.steps[place]
                part, limit = last_moments(self.simulation, solution, step, inputs, self.cell.window_v)
                if part is not None:
                    unfinished = watcher.cycle, watcher.position, part
            else:
                limit = nearest_limit(solution, self.cell.window_v)
            # A step that took too long, or ended by a foreign event, is part of the solution.
            cut = unfinished is not None or not watcher.gave_up
        trajectory = self._trajectory(watcher, unfinished)
        reached_s = trajectory.duration if trajectory is not None else 0.0
        failure = SimulationFailure(cause, watcher.step, watcher.cycle, reached_s, limit, cut)
        return ExperimentRun(trajectory, failure)

    def _trajectory(self, watcher: _Watcher, unfinished: Part | None = None) -> Trajectory | None:
        cycles = getattr(self.simulation._solution, "cycles", None) or ()
        solved = (
            (number, position, part)
            for number, cycle in zip(watcher.ended, cycles, strict=False)
            for position, part in enumerate(cycle.steps)
        )
        return to_trajectory(solved, self.steps, self.cell.heats, unfinished)


class _Watcher(pybamm.callbacks.Callback):  # type: ignore[misc]
    """Notes where an experiment stands, and why it stopped."""

    def __init__(self, on_step: Callable[[str, int], None] | None) -> None:
        self.step = ""
        self.cycle = 0
        self.position = 0
        # Cycles that the solution has: PyBaMM leaves out one whose only step had reached its end at its start.
        self.ended: list[int] = []
        self.cause = ""
        self.gave_up = False
        self._on_step = on_step

    def on_step_start(self, logs: dict[str, Any]) -> None:
        self.step = str(logs["step operating conditions"])
        self.cycle = int(logs["cycle number"][0])
        self.position = int(logs["step number"][0]) - 1
        if self._on_step:
            self._on_step(self.step, self.cycle)

    def on_cycle_end(self, logs: dict[str, Any]) -> None:
        self.ended.append(int(logs["cycle number"][0]))

    def on_experiment_error(self, logs: dict[str, Any]) -> None:
        self.cause = first_line(logs["error"])
        self.gave_up = True

    def on_experiment_infeasible_time(self, logs: dict[str, Any]) -> None:
        self.cause = "the step did not reach its end condition within its longest duration"

    def on_experiment_infeasible_event(self, logs: dict[str, Any]) -> None:
        self.cause = str(logs.get("termination", "an event outside the protocol"))
