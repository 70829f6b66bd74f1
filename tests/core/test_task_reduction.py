"""Eased tasks and the residuals of simulations that did not get to the end."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bsa.core.ageing.cycle_table import COLUMNS, CycleTable
from bsa.core.comparison.residuals import partial_residuals, residuals
from bsa.core.errors import BsaError
from bsa.core.run.journal import read_events
from bsa.core.run.loop import RunResult
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task import Experiment, Task
from bsa.core.task_reduction import TaskReduction, shortened
from bsa.core.trajectory import Trajectory
from bsa.experiments.run_record import read_run
from bsa_toy_cell import HIDDEN, record, space, toy_scaffold, toy_task
from bsa_toy_life import life, life_task

RunToy = Callable[..., RunResult]


def twice(trajectory: Trajectory) -> Trajectory:
    """The record two times in a row, as two cycles."""
    steps = [replace(step, cycle=1) for step in trajectory.steps]
    steps += [replace(step, start=step.start + 262, stop=step.stop + 262, cycle=2) for step in trajectory.steps]
    joined = [np.concatenate([signal, signal]) for signal in (trajectory.current, trajectory.voltage)]
    return Trajectory(
        np.concatenate([trajectory.time, trajectory.time + trajectory.time[-1]]), *joined, None, tuple(steps)
    )


def two_cycles() -> Task:
    task = toy_task()
    (experiment,) = task.experiments
    assert experiment.protocol is not None
    return replace(
        task,
        experiments=(
            replace(experiment, target=twice(record(HIDDEN)), protocol=experiment.protocol * 2, scored_cycle=2),
        ),
    )


def test_the_first_cycles_are_compared_as_a_whole() -> None:
    (experiment,) = two_cycles().experiments
    first = shortened(experiment, 1)
    assert first.target.cycles == (1,)
    assert first.target.duration == pytest.approx(record(HIDDEN).duration)
    assert first.protocol is not None
    assert len(first.protocol) == 1
    assert first.scored_cycle is None
    assert shortened(experiment, None) is experiment
    assert shortened(experiment, 5).target is experiment.target


def test_a_reduction_must_reduce() -> None:
    for wrong in ({"rate": 0.0}, {"rate": 1.5}, {"cycles": 0}):
        with pytest.raises(BsaError, match="must hold"):
            TaskReduction(**wrong)
    assert TaskReduction(0.5).words == "at 50 % of the currents"
    assert TaskReduction(cycles=1).words == "the first cycle alone"


@pytest.mark.parametrize(("samples", "unfinished", "finished"), [(2, False, 1), (100, True, 1), (202, False, 2)])
def test_what_was_finished_is_compared_and_the_rest_is_unknown(samples: int, unfinished: bool, finished: int) -> None:
    task = toy_task()
    whole = record(space().initial)
    reached = whole.slice(0, samples)
    if unfinished:
        reached = replace(reached, steps=(*reached.steps, replace(whole.steps[1], stop=samples)))
    failure = SimulationFailure("gave up", "Discharge", 1, reached.duration, "no salt left", unfinished)
    found = partial_residuals(task, Outcome((ExperimentRun(reached, failure),)))
    full = residuals(task, Outcome((ExperimentRun(whole),)))
    assert found is not None
    assert full is not None
    assert np.array_equal(found[: 17 * finished], full[: 17 * finished])
    assert np.all(np.isnan(found[17 * finished :]))
    assert len(found) == len(full)


def test_a_failure_before_the_scored_cycle_still_tells_of_the_first() -> None:
    task = two_cycles()
    whole = twice(record(space().initial))
    failure = SimulationFailure("gave up", "Discharge", 2)
    outcome = Outcome((ExperimentRun(whole.slice(0, 264), failure),))
    assert residuals(task, outcome) is None
    found = partial_residuals(task, outcome)
    assert found is not None
    assert np.count_nonzero(np.isfinite(found)) == 4 * 17
    assert partial_residuals(task, Outcome((ExperimentRun(None, failure),))) is None


def test_a_life_whose_first_cycle_has_no_discharge_is_reduced_to_it() -> None:
    target = life(20, 0.1)
    assert target.cycle_table is not None
    lines = {name: getattr(target.cycle_table, name)[1:] for name in ("cycle", *COLUMNS)}
    (experiment,) = life_task(target).experiments
    first = shortened(replace(experiment, target=replace(target, cycle_table=CycleTable(**lines))), 1)
    assert (first.target.cycle_table, first.target.cycles, first.detailed_cycles) == (None, (1,), (1,))


def fragile(breaks_above_ohm: float, name: str) -> object:
    return toy_scaffold(name, simulator={"use": "toy-cell", "options": {"breaks_above_ohm": breaks_above_ohm}})


@pytest.mark.slow
@pytest.mark.parametrize("name", ["least-squares", "hybrid"])
def test_eased_simulations_count_are_kept_and_come_back_on_resume(run_toy: RunToy, tmp_path: Path, name: str) -> None:
    # The start has 0.05 Ohm, and nothing runs above 0.04 at the full current.
    scaffold = fragile(0.04, name)
    result = run_toy(tmp_path / "whole", scaffold=scaffold, simulations=40, rounds=40)
    reduced = [trial for trial in result.trials if trial.reduction is not None]
    assert reduced
    assert result.trials[0].failed
    assert not any(trial.failed for trial in reduced[:1])
    assert all(trial.metrics is None and trial.residuals is None for trial in reduced)
    assert result.best.reduction is None
    assert result.lowest.objective < 0.1
    assert len(result.trials) <= 40
    kept = read_run(tmp_path / "whole")
    assert [trial.reduction for trial in kept.trials] == [trial.reduction for trial in result.trials]
    assert kept.failed == sum(trial.failed for trial in result.trials)
    page = (tmp_path / "whole" / "report.html").read_text()
    assert "at 50 % of the currents" in page
    assert "were of a reduced task" in page
    lines = (tmp_path / "whole" / "journal.jsonl").read_bytes().splitlines(keepends=True)
    for kept in range(2, len(lines), 9):
        folder = tmp_path / f"cut-{kept}"
        folder.mkdir()
        (folder / "journal.jsonl").write_bytes(b"".join(lines[:kept]))
        again = run_toy(folder, scaffold=scaffold, simulations=40, rounds=40)
        assert [(dict(t.candidate), t.reduction) for t in again.trials] == [
            (dict(t.candidate), t.reduction) for t in result.trials
        ]
        assert sum(event["event"] == "trial" for event in read_events(folder)) == len(result.trials)


def test_a_simulator_that_cannot_reduce_says_so_and_the_run_goes_on(
    run_toy: RunToy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bsa_toy_cell import ToyCell

    def cannot(self: ToyCell, candidates: Sequence[object], experiments: tuple[Experiment, ...]) -> None:
        return None

    from bsa.core.hooks import hookimpl

    monkeypatch.setattr(ToyCell, "simulate_variant", hookimpl(cannot))
    result = run_toy(tmp_path, scaffold=fragile(0.04, "least-squares"), simulations=60, rounds=60)
    causes = {
        trial.failure.cause for trial in result.trials if trial.reduction is not None and trial.failure is not None
    }
    assert causes == {"this simulator cannot reduce a task"}
    assert result.lowest.objective < 0.1
