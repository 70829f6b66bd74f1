"""Ways back to a cell that runs, on made-up cells whose limits are known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bsa.core.feedback import Feedback
from bsa.core.metrics import PaperMetrics
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.simulation import SimulationFailure
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.task_reduction import TaskReduction
from bsa.core.trajectory import FloatArray, Step, StepKind, Trajectory
from bsa.core.trial import Trial
from bsa.plugins.proposers.continuation import Continuation, CurrentRateContinuation, FirstCycleContinuation
from bsa.plugins.proposers.feasibility import Feasibility, outlasts, progress, smaller_direction

SPACE = ParameterSpace(tuple(Parameter(name, 0.5, 0.0, 1.0) for name in ("a", "b", "c")))
GOOD = PaperMetrics(1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)


def discharge(seconds: float, drop_v: float = 0.0) -> Trajectory:
    """A rest, then a discharge whose voltage falls by so much at once."""
    time = np.append([0.0, 1.0], np.linspace(1.0, seconds, 5))
    voltage = np.append([4.0, 4.0], 4.0 - drop_v - time[2:] / 1e6)
    steps = (Step(StepKind.REST, 0, 2, 1), Step(StepKind.CC_DISCHARGE, 2, 7, 1, position=1))
    return Trajectory(time, np.append([0.0, 0.0], np.ones(5)), voltage, None, steps)


def made(
    candidate: dict[str, float],
    reduction: TaskReduction | None,
    runs: bool,
    seconds: float = 1000.0,
    partial: FloatArray | None = None,
    drop_v: float = 0.0,
) -> Trial:
    return Trial(
        index=0,
        phase="search",
        round=1,
        candidate=candidate,
        metrics=GOOD if runs and reduction is None else None,
        failure=None if runs else SimulationFailure("gave up"),
        residuals=np.ones(3) if runs and reduction is None else None,
        feedback=Feedback(),
        curves=(discharge(seconds, drop_v),),
        seconds=0.1,
        reduction=reduction,
        partial=partial,
    )


def travel(
    continuation: Continuation, simulate: Callable[[dict[str, float], TaskReduction | None], Trial], limit: int = 100
) -> list[Trial]:
    trials: list[Trial] = []
    while candidates := continuation.ask(limit):
        batch = [simulate(c, reduction) for c, reduction in zip(candidates, continuation.reductions, strict=True)]
        continuation.tell(batch)
        trials += batch
        assert len(trials) < 60
    return trials


def found(trials: list[Trial]) -> Trial | None:
    """The first trial of the whole task that ran to its end."""
    return next((trial for trial in trials if trial.reduction is None and trial.residuals is not None), None)


def stiff(strength: float) -> Callable[[dict[str, float], TaskReduction | None], Trial]:
    """Runs where rate x severity is at most 1; only the first parameter eases it, and lowers the polarisation."""

    def simulate(candidate: dict[str, float], reduction: TaskReduction | None) -> Trial:
        rate = 1.0 if reduction is None else reduction.rate
        severity = strength * np.exp(-3.0 * (candidate["a"] - 0.5))
        # The second one makes the cell larger, which lengthens the discharge and eases nothing.
        seconds = 1000.0 * (1.0 + candidate["b"]) / rate
        return made(candidate, reduction, rate * severity <= 1.0, seconds, drop_v=0.1 * rate * severity)

    return simulate


@pytest.mark.parametrize("strength", [1.2, 1.8, 3.0])
def test_the_climb_finds_out_what_eases_the_cell_and_comes_back(strength: float) -> None:
    continuation = CurrentRateContinuation(SPACE, np.full(3, 0.5), np.zeros(3))
    trials = travel(continuation, stiff(strength))
    whole = found(trials)
    assert whole is not None
    moved = SPACE.to_unit(whole.candidate) - 0.5
    assert moved[0] > 0.1
    assert moved[1:] == pytest.approx([0.0, 0.0], abs=1e-3)
    rates = [trial.reduction.rate for trial in trials if trial.reduction is not None]
    assert rates[0] == 0.5
    assert max(rates) > 0.5
    assert len(trials) <= 18


def test_a_neighbour_that_fails_shows_the_way_too() -> None:
    continuation = CurrentRateContinuation(SPACE, np.array([0.6, 0.5, 0.5]), np.zeros(3))
    trials = travel(continuation, stiff(2.5))
    assert trials[0].reduction == TaskReduction(0.5)
    assert not trials[0].failed
    assert trials[1].failed  # the neighbour on the side of the room has less of what eases the cell
    whole = found(trials)
    assert whole is not None
    assert whole.candidate["a"] > 0.7


def test_a_cell_that_runs_at_no_rate_is_given_up_soon() -> None:
    continuation = CurrentRateContinuation(SPACE, np.full(3, 0.5), np.ones(3))
    trials = travel(continuation, stiff(100.0))
    assert continuation.over
    assert found(trials) is None
    assert [trial.reduction for trial in trials] == [TaskReduction(0.5), TaskReduction(0.25)]


def test_without_room_for_slopes_the_rules_of_thumb_lead() -> None:
    continuation = CurrentRateContinuation(SPACE, np.full(3, 0.5), np.array([1.0, 0.0, 0.0]))
    trials = travel(continuation, stiff(1.8), limit=2)
    assert found(trials) is not None
    assert sum(trial.reduction == TaskReduction(0.5) for trial in trials) == 1


def test_the_first_cycle_leads_to_the_second() -> None:
    truth = np.array([0.7, 0.4, 0.6])

    def simulate(candidate: dict[str, float], reduction: TaskReduction | None) -> Trial:
        off = SPACE.to_unit(candidate) - truth
        if reduction is None:
            return made(candidate, None, bool(np.linalg.norm(off) < 0.1))
        assert reduction == TaskReduction(cycles=1)
        matrix = np.vander(np.linspace(0.0, 1.0, 8), 3)
        return made(candidate, reduction, True, partial=50.0 * matrix @ off)

    continuation = FirstCycleContinuation(SPACE, np.full(3, 0.5), 1)
    trials = travel(continuation, simulate)
    assert found(trials) is not None
    assert len(trials) <= 11
    assert travel(
        FirstCycleContinuation(SPACE, np.full(3, 0.5), 1, allowance=3), simulate
    )  # no room for a Jacobian: it ends


def failing_task() -> Task:
    protocol = (("Discharge at 1C until 3 V",),)
    return Task("t", CellModel("toy"), SPACE, (Experiment("r", discharge(1000.0), protocol),))


def test_failed_trials_are_ordered_by_how_far_they_got_and_then_by_how_well() -> None:
    task, none = failing_task(), dict(SPACE.initial)
    near = made(none, None, False, 400.0, np.array([1.0, np.nan]))
    far = made(none, None, False, 800.0, np.array([9.0, np.nan]))
    as_far_and_better = made(none, None, False, 801.0, np.array([2.0, np.nan]))
    assert max([near, far, as_far_and_better], key=lambda trial: progress(task, trial)) is as_far_and_better


def test_a_cell_that_outlasts_its_steps_is_made_smaller() -> None:
    from bsa.plugins.pybamm.before_search.presets import preset_space

    space = preset_space("Chen2020", "geometry")
    direction = dict(zip(space.names, smaller_direction(replace(failing_task(), space=space)), strict=True))
    assert direction["Negative electrode thickness [m]"] == direction["Positive electrode thickness [m]"] == -1
    assert sum(map(abs, direction.values())) == 2
    late = made(dict(SPACE.initial), None, False, 2000.0)
    assert not outlasts(failing_task(), late)
    assert late.failure is not None
    late = replace(late, failure=replace(late.failure, unfinished=True))
    assert outlasts(failing_task(), late)
    task = replace(failing_task(), space=space)
    start = replace(late, candidate=dict(space.initial))
    first = Feasibility(task, start, 1).ask()[0]
    assert np.sum(first < space.to_unit(space.initial) - 1e-9) == 2
