"""A stage that simulates only the ends of fits to a cell at equilibrium."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from bsa.core.comparison.residuals import residuals
from bsa.core.feedback import Feedback
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task import Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.core.trial import Trial
from bsa.plugins.proposers.equilibrium_fit import EquilibriumFit
from bsa.plugins.proposers.stage_data import view_of
from bsa.plugins.proposers.stage_fit import StageChoice
from bsa_toy_cell import toy_task

HIDDEN = {"Level [V]": 4.1, "Slope [V]": 0.55}
CHOICE = StageChoice(name="equilibrium", data="open-circuit")


def voltage(candidate: Candidate, share: np.ndarray, polarisation: float = 0.0) -> np.ndarray:
    # The polarisation grows a little with the slope, so that the correction is not exact at once.
    return np.asarray(
        candidate["Level [V]"] - candidate["Slope [V]"] * share**1.5 - polarisation * candidate["Slope [V]"] * share
    )


def task() -> Task:
    time = np.linspace(0.0, 20 * 3600.0, 400)
    step = (Step(StepKind.CC_DISCHARGE, 0, 400),)
    record = Trajectory(time, np.full(400, 0.05), voltage(HIDDEN, time / time[-1], 0.04), None, step)
    space = ParameterSpace(
        (
            Parameter("Level [V]", 3.9, 3.0, 5.0, "linear", deviation=0.2, prior=True),
            Parameter("Slope [V]", 0.3, 0.05, 2.0, "log", deviation=0.5, prior=True),
        )
    )
    return replace(toy_task(), space=space, experiments=(Experiment("slow", record),))


def simulated(task: Task, candidate: Candidate, polarisation: float) -> Outcome:
    record = task.experiments[0].target
    shown = voltage(candidate, record.time / record.time[-1], polarisation)
    return Outcome((ExperimentRun(record.changed(voltage=shown)),), 0.0)


def trial(task: Task, candidate: Candidate, index: int, polarisation: float = 0.04) -> Trial:
    seen = residuals(task, simulated(task, candidate, polarisation))
    return Trial(index, "search", 1, dict(candidate), None, None, seen, Feedback({}), (None,), 0.0)


def fit(task: Task, polarised: float = 0.0) -> EquilibriumFit:
    def equilibrium(candidates: Sequence[Candidate]) -> list[Outcome]:
        return [simulated(task, candidate, polarised) for candidate in candidates]

    free = np.ones(2, dtype=bool)
    view = view_of(task, "open-circuit")
    return EquilibriumFit(task, CHOICE, view, free, trial(task, task.space.initial, 0), 30, equilibrium)


def test_a_few_simulations_find_what_the_slow_record_shows() -> None:
    problem = task()
    stage = fit(problem)
    best, count = trial(problem, problem.space.initial, 0), 0
    while candidates := stage.ask(30):
        count += 1
        best = stage.tell([trial(problem, candidates[0], count)])
    assert count <= 4
    for name, value in HIDDEN.items():
        assert best.candidate[name] == pytest.approx(value, rel=2e-3)


def test_a_worse_simulation_is_answered_by_half_the_step_and_not_without_end() -> None:
    problem = task()
    stage = fit(problem)
    start = problem.space.initial["Level [V]"]
    steps = []
    while candidates := stage.ask(30):
        steps.append(abs(candidates[0]["Level [V]"] - start))
        failure = SimulationFailure("too far")
        stage.tell([Trial(len(steps), "search", 1, candidates[0], None, failure, None, Feedback({}), (None,), 0.0)])
    assert len(steps) == 4
    assert steps == pytest.approx([steps[0] / 2**n for n in range(4)])


def test_where_the_start_ran_empty_a_fit_without_a_correction_is_tried_first() -> None:
    problem = task()
    free, view = np.ones(2, dtype=bool), view_of(problem, "open-circuit")

    def equilibrium(candidates: Sequence[Candidate]) -> list[Outcome]:
        return [simulated(problem, candidate, 0.04) for candidate in candidates]

    empty = problem.experiments[0].target.changed(voltage=np.full(400, 0.5))
    seen = residuals(problem, Outcome((ExperimentRun(empty),)))
    start = replace(trial(problem, problem.space.initial, 0), residuals=seen, limits=("the simulated cell was empty",))
    stage, asked = EquilibriumFit(problem, CHOICE, view, free, start, 30, equilibrium), []
    while candidates := stage.ask(30):
        asked.append(candidates[0])
        failure = SimulationFailure("too far")
        stage.tell([Trial(len(asked), "search", 1, asked[-1], None, failure, None, Feedback({}), (None,), 0.0)])
    assert len(asked) == 8
    # This toy's cell at equilibrium is its simulation: the fit without a correction finds what is hidden at once.
    for name, value in HIDDEN.items():
        assert asked[0][name] == pytest.approx(value, rel=2e-2)
        assert asked[4][name] != pytest.approx(value, rel=2e-2)


def test_from_a_cell_that_is_empty_all_along_draws_from_the_priors_lead_away() -> None:
    problem = task()
    free, view = np.ones(2, dtype=bool), view_of(problem, "open-circuit")
    empty = Outcome((ExperimentRun(problem.experiments[0].target.changed(voltage=np.full(400, 0.5))),), 0.0)

    def equilibrium(candidates: Sequence[Candidate]) -> list[Outcome]:
        # No derivative tells that a higher level would help.
        return [empty if one["Level [V]"] < 4.0 else simulated(problem, one, 0.04) for one in candidates]

    seen = residuals(problem, empty)
    start = replace(trial(problem, problem.space.initial, 0), residuals=seen, limits=("the simulated cell was empty",))
    stage = EquilibriumFit(problem, CHOICE, view, free, start, 30, equilibrium)
    (found,) = stage.ask(30)
    for name, value in HIDDEN.items():
        assert found[name] == pytest.approx(value, rel=2e-2)


def test_the_budget_is_kept() -> None:
    stage = fit(task())
    assert stage.ask(0) == []
