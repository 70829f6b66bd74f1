"""One experiment on one cell model, compiled once and solved for any candidate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...core.errors import BsaError, did_you_mean
from ...core.parameters import Candidate
from ...core.simulation import ExperimentRun, SimulationFailure
from ...core.target import CellChange, CyclableLithium, InitialSoc, Target, Value, change_of
from ...core.task import CellModel, Experiment
from ...core.trajectory import StepKind
from . import drive
from .last_moments import last_moments, nearest_limit
from .mesh import search_spatial_methods, search_submeshes
from .ocp_shape import keeping_ocp_falling
from .parameter_sets import bake, input_values, load, open_to_search, pybamm
from .state_of_charge import InitialState, initial_concentration
from .step_solutions import Unfinished, at_samples_of, cut_short, keep_solver_steps_of_holds, step_kind, to_trajectory

MODELS = {"SPM": "SPM", "SPMe": "SPMe", "DFN": "DFN"}


@dataclass(frozen=True)
class Accuracy:
    """Discretisation and tolerances of a solve.

    Attributes
    ----------
    rtol, atol : float
        Tolerances of the integrator.
    points : int or None
        Mesh points in every domain; None keeps PyBaMM's own.
    standard_mesh : bool
        Whether to use PyBaMM's own mesh, whose lengths are numbers, instead of one whose lengths are inputs.
    """

    rtol: float = 1e-5
    atol: float = 1e-6
    points: int | None = None
    standard_mesh: bool = False


SEARCH = Accuracy()
REFERENCE = Accuracy(rtol=1e-6, atol=1e-7, standard_mesh=True)
"""For final scores. At atol 1e-8 every experiment on Ecker2015 fails in its first rest."""


def make_model(cell: CellModel) -> Any:
    """The PyBaMM model of a cell.

    Raises
    ------
    BsaError
        If the model or one of its options does not exist.
    """
    if cell.model not in MODELS:
        raise BsaError(
            f'there is no model "{cell.model}".',
            did_you_mean(cell.model, MODELS) or f"choose one of {', '.join(MODELS)}.",
        )
    options = {key: tuple(value) if isinstance(value, list) else value for key, value in cell.options.items()}
    try:
        return getattr(pybamm.lithium_ion, MODELS[cell.model])(options)
    except pybamm.OptionError as error:
        raise BsaError(
            f"PyBaMM refuses the model options {options}: {' '.join(str(error).split())}",
            "see pybamm's BatteryModelOptions.",
        ) from None


class CompiledExperiment:
    """An experiment, ready to be solved for many candidates without a rebuild.

    Parameters
    ----------
    cell : CellModel
        Equations and base parameters.
    experiment : Experiment
        What to simulate.
    targets : mapping of str to Target
        What is searched, by the names that candidates use; all become inputs.
    accuracy : Accuracy
        Mesh and tolerances.
    baked : CellChange, optional
        Values built into the model; needed for geometry on the standard mesh.

    Attributes
    ----------
    simulation : pybamm.Simulation
        The compiled simulation itself.
    steps : sequence of sequence of pybamm steps
        The experiment's cycles, each with its steps.
    heats : bool
        Whether the temperature changes.
    window_v : tuple of float
        Lower and upper voltage cut-off, V.
    """

    def __init__(
        self,
        cell: CellModel,
        experiment: Experiment,
        targets: Mapping[str, Target],
        accuracy: Accuracy = SEARCH,
        baked: CellChange | None = None,
    ) -> None:
        self._experiment = experiment
        self._targets = dict(targets)
        baked = baked or CellChange()
        model = make_model(cell)
        self.heats = model.options["thermal"] != "isothermal"
        values = load(cell.parameter_set, cell.overrides)
        if experiment.temperature_k is not None:
            values.update(
                {
                    "Ambient temperature [K]": experiment.temperature_k,
                    "Initial temperature [K]": experiment.temperature_k,
                }
            )
        own_soc = baked.soc_of(experiment.name)
        self._initial_soc = experiment.initial_soc if own_soc is None else own_soc
        bake(values, baked)
        starts = (InitialSoc(), InitialSoc(experiment.name), CyclableLithium())
        by_state = (
            self._initial_soc is not None
            or experiment.initial_voltage is not None
            or baked.cyclable_lithium != 1.0
            or any(target in starts for target in self._targets.values())
        )
        self._lithium = baked.cyclable_lithium
        self._feasible = keeping_ocp_falling(values, self._targets)
        self._state = InitialState(values) if by_state else None
        open_to_search(values, self._targets)
        if by_state:
            concentrations = [initial_concentration(which) for which in ("Negative", "Positive")]
            open_to_search(values, {name: Value(name) for name in concentrations})
        self.steps = drive.steps_of(experiment)
        by_current = experiment.protocol is None
        self.window_v = (float(values["Lower voltage cut-off [V]"]), float(values["Upper voltage cut-off [V]"]))
        if by_current:
            drive.widen_cut_offs(values)
        points = dict.fromkeys(("x_n", "x_s", "x_p", "r_n", "r_p"), accuracy.points)
        self.simulation = pybamm.Simulation(
            model,
            experiment=pybamm.Experiment([tuple(cycle) for cycle in self.steps], period="30 seconds"),
            parameter_values=values,
            submesh_types=None if accuracy.standard_mesh else search_submeshes(model),
            spatial_methods=None if accuracy.standard_mesh else search_spatial_methods(model),
            var_pts={**model.default_var_pts, **points} if accuracy.points else None,
            solver=pybamm.IDAKLUSolver(rtol=accuracy.rtol, atol=accuracy.atol, options=self._solver_options()),
            # Steps of a measured current differ in value alone: one shared model serves them all.
            experiment_model_mode="unified" if by_current else "legacy",
        )
        keep_solver_steps_of_holds(self.simulation.experiment)

    def _solver_options(self) -> dict[str, float]:
        drives = [step.input_value[:, 0] for cycle in self.steps for step in cycle if step_kind(step) is StepKind.DRIVE]
        # A near-singular candidate can spin for minutes: a sound solve advances faster than this even
        # while it settles after a jump of the current.
        options: dict[str, float] = {
            "max_num_steps": 20_000,
            "num_steps_no_progress": 200,
            "t_no_progress": 1e-2,
            "silence_sundials_errors": True,  # failures come back as trials
        }
        if drives:
            # The integrator must not step over what the record resolves.
            options["dt_max"] = max(60.0, 20.0 * max(float(np.median(np.diff(time))) for time in drives))
        return options

    def inputs(self, candidate: Candidate) -> dict[str, float]:
        """What PyBaMM's solve is given for a candidate.

        Raises
        ------
        ValueError
            If the electrodes cannot start at the wanted state of charge.
        """
        change = self._feasible(change_of(self._targets, candidate))
        inputs = input_values(self._targets, change)
        if self._state is not None:
            change = replace(change, cyclable_lithium=self._lithium * change.cyclable_lithium)
            soc = change.soc_of(self._experiment.name)
            soc = self._initial_soc if soc is None else soc
            if soc is None and self._experiment.initial_voltage is not None:
                soc = self._state.soc_at(self._experiment.initial_voltage, change)
            inputs |= self._state.concentrations(change, soc)
        return inputs

    def solve(self, candidate: Candidate, on_step: Callable[[str, int], None] | None = None) -> ExperimentRun:
        """Simulate one candidate.

        Parameters
        ----------
        candidate : Candidate
            A value for every searched parameter.
        on_step : callable, optional
            Called with the step's words and its cycle before each step, so that a watcher knows where a
            hang began.

        Returns
        -------
        ExperimentRun
            With the partial trajectory and the failed step if it did not finish.
        """
        watcher = _Watcher(on_step)
        cause = ""
        self.simulation._solution = None  # a failed solve must not show its predecessor's result
        try:
            inputs = self.inputs(candidate)
            self.simulation.solve(inputs=inputs, calc_esoh=False, callbacks=[watcher], showprogress=False)
        except (pybamm.SolverError, ValueError, ArithmeticError, RuntimeError) as error:
            cause = first_line(error)
        cause = cause or watcher.cause
        if cause:
            return self._failed(cause, watcher, inputs if watcher.step else {})
        trajectory = to_trajectory(self.simulation._solution, self.steps, self.heats)
        if trajectory is not None and self._experiment.protocol is None:
            trajectory = at_samples_of(self._experiment.target, trajectory)
        return ExperimentRun(trajectory)

    def _failed(self, cause: str, watcher: _Watcher, inputs: dict[str, float]) -> ExperimentRun:
        """What was reached, the last moments of the step it died in included where a protocol drives the cell."""
        solution = self.simulation._solution
        unfinished, limit, cut = None, "", False
        if solution is not None and self._experiment.protocol is not None:
            if watcher.gave_up:
                place = sum(len(cycle) for cycle in self.steps[: watcher.cycle - 1]) + watcher.position
                found = last_moments(self.simulation, self.simulation.experiment.steps[place], inputs, self.window_v)
                limit = found.limit
                if found.part is not None:
                    unfinished = Unfinished(found.part, watcher.cycle, watcher.position)
            else:
                limit = nearest_limit(solution, self.window_v)
            # A step that took too long, or ended by a foreign event, is part of the solution.
            cut = unfinished is not None or not watcher.gave_up
        trajectory = to_trajectory(solution, self.steps, self.heats, unfinished)
        if trajectory is not None and self._experiment.protocol is None:
            trajectory = at_samples_of(self._experiment.target, trajectory)
            cut = cut_short(self._experiment.target, trajectory)
        reached_s = trajectory.duration if trajectory is not None else 0.0
        failure = SimulationFailure(cause, watcher.step, watcher.cycle, reached_s, limit, cut)
        return ExperimentRun(trajectory, failure)


def first_line(error: Exception) -> str:
    """What an error says, in a line."""
    lines = str(error).strip().splitlines()
    return lines[0][:200] if lines else type(error).__name__


class _Watcher(pybamm.callbacks.Callback):  # type: ignore[misc]
    """Notes where an experiment stands, and why it stopped."""

    def __init__(self, on_step: Callable[[str, int], None] | None) -> None:
        self.step = ""
        self.cycle = 0
        self.position = 0
        self.cause = ""
        self.gave_up = False
        self._on_step = on_step

    def on_step_start(self, logs: dict[str, Any]) -> None:
        self.step = str(logs["step operating conditions"])
        self.cycle = int(logs["cycle number"][0])
        self.position = int(logs["step number"][0]) - 1
        if self._on_step:
            self._on_step(self.step, self.cycle)

    def on_experiment_error(self, logs: dict[str, Any]) -> None:
        self.cause = first_line(logs["error"])
        self.gave_up = True

    def on_experiment_infeasible_time(self, logs: dict[str, Any]) -> None:
        self.cause = "the step did not reach its end condition within its longest duration"

    def on_experiment_infeasible_event(self, logs: dict[str, Any]) -> None:
        self.cause = str(logs.get("termination", "an event outside the protocol"))
