from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bsa.core.comparison.residuals import noise_of_residuals
from bsa.core.parameters import ParameterSpace
from bsa.core.run.journal import FILE_NAME, read_events
from bsa.core.run.loop import RunResult
from bsa.core.task import Task
from bsa.core.trial import Trial
from bsa.plugins.proposers.descent import Descent, DescentOptions
from bsa.plugins.proposers.feasibility import gentle_direction
from bsa_toy_cell import CAPACITY, HIDDEN, RELAXATION, toy_scaffold, toy_task

RunToy = Callable[..., RunResult]

OHM = "breaks_above_ohm"


def fragile(breaks_above_ohm: float, name: str = "least-squares") -> object:
    return toy_scaffold(name, simulator={"use": "toy-cell", "options": {OHM: breaks_above_ohm}})


def test_it_recovers_the_hidden_cell_and_knows_when_to_stop(run_toy: RunToy) -> None:
    # It says itself when it is finished: rounds and patience do not stop it.
    result = run_toy(scaffold=toy_scaffold("least-squares"), rounds=1, patience=1, simulations=100, warm_up=0)
    assert result.status == "finished"
    assert len(result.trials) < 30
    assert result.best_metrics is not None
    assert result.best_metrics.mape < 0.1
    for name, value in HIDDEN.items():
        assert result.best.candidate[name] == pytest.approx(value, rel=0.02), name


def noisy_task(noise_v: float, wave_v: float = 0.0) -> Task:
    """The toy task with a noisy record; no parameter explains the wave."""
    task = toy_task()
    experiment = task.experiments[0]
    record = experiment.target
    noise = np.random.default_rng(3).normal(0.0, noise_v, len(record))
    wave = wave_v * np.sin(record.time / 40.0)
    return replace(
        task, experiments=(replace(experiment, target=record.changed(voltage=record.voltage + noise + wave)),)
    )


def last_words(folder: Path) -> str:
    return [event["rationale"] for event in read_events(folder) if event["event"] == "proposal"][-1]


@pytest.mark.parametrize("noise_v", [3e-4, 3e-3])
def test_a_fit_goes_on_to_the_noise_and_says_so(run_toy: RunToy, tmp_path: Path, noise_v: float) -> None:
    task = noisy_task(noise_v)
    level = noise_of_residuals(task)
    assert np.max(level) == pytest.approx(noise_v / 1e-3, rel=0.2)
    result = run_toy(scaffold=toy_scaffold("least-squares"), simulations=60, warm_up=0, task=task)
    assert "less than the noise hides" in last_words(tmp_path / "run")
    truth = run_toy(tmp_path / "truth", scaffold=toy_scaffold("least-squares"), simulations=1, task=at_truth(task))
    costs = [trial.residuals @ trial.residuals for trial in result.trials if trial.residuals is not None]
    assert truth.best.residuals is not None
    assert min(costs) < 1.02 * truth.best.residuals @ truth.best.residuals


def at_truth(task: Task) -> Task:
    """The same, searched from the hidden values."""
    moved = tuple(replace(p, initial=HIDDEN.get(p.name, p.initial)) for p in task.space)
    return replace(task, space=ParameterSpace(moved))


@pytest.mark.slow
def test_a_fit_that_ends_above_the_noise_says_why(run_toy: RunToy, tmp_path: Path) -> None:
    run_toy(scaffold=toy_scaffold("least-squares"), simulations=80, warm_up=0, task=noisy_task(1e-4, 2e-3))
    assert "this misfit leaves uncertain" in last_words(tmp_path / "run")


@pytest.mark.slow
def test_every_simulation_counts_and_the_budget_is_kept(run_toy: RunToy, tmp_path: Path) -> None:
    for budget in (1, 2, 4, 5, 6, 9):
        result = run_toy(tmp_path / str(budget), scaffold=toy_scaffold("least-squares"), simulations=budget, rounds=80)
        assert len(result.trials) <= budget


@pytest.mark.slow
def test_the_path_does_not_depend_on_where_the_run_was_cut(run_toy: RunToy, tmp_path: Path) -> None:
    scaffold = toy_scaffold("least-squares")
    whole = run_toy(tmp_path / "whole", scaffold=scaffold)
    lines = (tmp_path / "whole" / FILE_NAME).read_bytes().splitlines(keepends=True)
    for kept in range(1, len(lines), 5):
        folder = tmp_path / f"cut-{kept}"
        folder.mkdir()
        (folder / FILE_NAME).write_bytes(b"".join(lines[:kept]))
        resumed = run_toy(folder, scaffold=scaffold)
        assert [dict(t.candidate) for t in resumed.trials] == [dict(t.candidate) for t in whole.trials]
        assert sum(event["event"] == "trial" for event in read_events(folder)) == len(whole.trials)


def test_a_start_that_fails_is_made_feasible_first(run_toy: RunToy) -> None:
    # The start has 0.05 Ohm: nothing simulates there.
    result = run_toy(scaffold=fragile(0.04), simulations=60, rounds=60)
    assert not result.trials[0].ok
    assert result.best.ok
    assert result.lowest.objective < 0.1


def test_a_cell_that_never_simulates_ends_without_an_error(run_toy: RunToy) -> None:
    result = run_toy(scaffold=fragile(0.0), simulations=25, rounds=60)
    assert not result.best.ok
    assert len(result.trials) == 25


def test_gentle_means_smaller_particles_and_more_pores() -> None:
    from bsa.plugins.pybamm.before_search.presets import preset_space

    space = preset_space("Chen2020", "geometry")
    direction = dict(zip(space.names, gentle_direction(replace(toy_task(), space=space)), strict=True))
    assert direction["Negative particle radius [m]"] == -1
    assert direction["Positive electrode porosity"] == 1
    assert direction["Negative electrode Bruggeman coefficient (electrolyte)"] == -1
    assert not np.any(gentle_direction(toy_task()))


def test_a_trap_is_left_by_beginning_elsewhere(run_toy: RunToy) -> None:
    task = toy_task({**HIDDEN, CAPACITY: 2.9, RELAXATION: 900.0})
    result = run_toy(task=task, scaffold=toy_scaffold("least-squares"), simulations=100, rounds=80)
    assert result.lowest.objective < 0.05


def test_after_a_trap_both_sides_of_every_parameter_are_tried(run_toy: RunToy) -> None:
    task = toy_task()
    space = task.space
    origin = space.to_unit(space.initial)
    first = run_toy(task=task, scaffold=toy_scaffold("default"), warm_up=0).trials[0]

    def trial(candidate: dict[str, float]) -> Trial:
        away = space.to_unit(candidate) - origin
        # Downhill at the start points away from the well at +0.25 of the first parameter.
        wrong_way = 40.0 + 10.0 * np.tanh(20.0 * away[0])
        well = 100.0 * np.abs(away - 0.25 * np.eye(len(away))[0])
        values = well if np.linalg.norm(well) < 20.0 else np.append(well[1:], wrong_way)
        return replace(first, candidate=candidate, residuals=values)

    descent = Descent(task, DescentOptions(), seed=1, start=trial(dict(space.initial)))
    for _ in range(40):
        asked = descent.ask(100)
        if not asked:
            break
        descent.tell([trial(dict(candidate)) for candidate in asked])
    assert descent.base is not None
    found = space.to_unit(descent.base.candidate) - origin
    assert found[0] == pytest.approx(0.25, abs=0.01)
    assert found[1:] == pytest.approx(0.0, abs=0.01)


def test_a_point_that_is_taken_over_brings_what_the_trials_near_it_tell(run_toy: RunToy) -> None:
    task = toy_task()
    space = task.space
    origin = space.to_unit(space.initial)
    first = run_toy(task=task, scaffold=toy_scaffold("default"), warm_up=0).trials[0]
    slopes = 50.0 * np.eye(len(origin)) + np.random.default_rng(5).normal(0.0, 10.0, (len(origin), len(origin)))
    goal, there = origin + 0.1, origin + 0.08

    def trial(point: np.ndarray) -> Trial:
        # Near the goal the slopes are others than at the start, and not in proportion.
        matrix = slopes if np.linalg.norm(point - goal) < 0.1 else slopes[::-1]
        return replace(first, candidate=space.from_unit(point), residuals=matrix @ (point - goal))

    descent = Descent(task, DescentOptions(), seed=1, start=trial(origin))
    descent.tell([trial(space.to_unit(candidate)) for candidate in descent.ask(100)])
    near = [trial(there + step) for step in 0.01 * np.eye(len(origin))]
    descent.adopt(trial(there), [trial(origin), *near])
    (asked,) = descent.ask(100)
    assert space.to_unit(asked) == pytest.approx(goal, abs=1e-3)


@pytest.mark.parametrize(
    ("varied", "said"),
    [
        ((), "no parameter could be varied there, for all simulations nearby failed."),
        ((1, 2, 3), f"{CAPACITY} could not be varied there: simulations with other values failed."),
    ],
)
def test_a_fit_says_what_could_not_be_varied(run_toy: RunToy, varied: tuple[int, ...], said: str) -> None:
    task = toy_task()
    space = task.space
    origin = space.to_unit(space.initial)
    first = run_toy(task=task, scaffold=toy_scaffold("default"), warm_up=0).trials[0]

    def trial(candidate: dict[str, float]) -> Trial:
        away = space.to_unit(candidate) - origin
        fixed = np.delete(away, varied)
        failed = bool(np.any(np.abs(fixed) > 1e-9))
        return replace(first, candidate=candidate, residuals=None if failed else np.append(away - 0.1, np.full(9, 5.0)))

    descent = Descent(task, DescentOptions(restarts=0), seed=1, start=trial(dict(space.initial)))
    while asked := descent.ask(100):
        descent.tell([trial(dict(candidate)) for candidate in asked])
    assert descent.ending.endswith(said)
