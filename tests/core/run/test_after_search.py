"""What is reported of a run is of one trial, and the best score is named where it is another's."""

import json
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bsa.core.comparison.signal_metrics import SignalMetrics
from bsa.core.feedback import Feedback
from bsa.core.inference.identifiability import Identifiability
from bsa.core.inference.post_fit_analysis import PostFitAnalysis
from bsa.core.parameters import Candidate
from bsa.core.run import after_search
from bsa.core.run.after_search import AfterSearch
from bsa.core.run.journal import FILE_NAME, Journal, read_events
from bsa.core.run.listener import SILENT
from bsa.core.run.loop import Run, RunResult
from bsa.core.run.recording import Recorder
from bsa.core.run.run_config import RunConfig
from bsa.core.trial import Trial, closest, likeliest, lowest
from bsa.experiments.report.page import render
from bsa.experiments.run_record import read_run
from bsa_toy_cell import toy_scaffold
from bsa_toy_life import FadingLives, fading_task
from scipy.stats import t as student

from ...conftest import RunToy

RESULTS = ("result.json", "best_parameters.json")


def trial(index: int, objective: float | None, residual: float | None, features: bool = True) -> Trial:
    metrics = None if objective is None else SignalMetrics(objective, {})
    residuals = None if residual is None else np.array([residual, -residual])
    feedback = Feedback({"features": ["x"]} if features else {})
    candidate: Candidate = {}
    return Trial(index, "search", index, candidate, metrics, None, residuals, feedback, (), 0.0)


def test_the_likeliest_follows_the_record_and_the_lowest_has_the_best_score() -> None:
    trials = [trial(0, 9.0, 9.0), trial(1, 2.0, 3.0), trial(2, 3.0, 1.0), trial(3, 2.5, 1.0), trial(4, None, None)]
    assert (likeliest(trials).index, lowest(trials).index) == (3, 1)
    assert closest(trials).index == 3
    assert closest([trial(0, 9.0, 1.0, features=False), trial(1, 2.0, 3.0, features=False)]).index == 1
    failed = [trial(0, None, None), trial(1, None, None)]
    assert likeliest(failed) is lowest(failed) is failed[0]


@pytest.mark.slow
def test_parameters_errors_and_intervals_are_of_one_trial(run_toy: RunToy, tmp_path: Path) -> None:
    scaffold = toy_scaffold("random")
    result = run_toy(scaffold=scaffold, simulations=6, rounds=6, warm_up=0, analysing=True)
    folder = tmp_path / "run"
    found, parameters = (json.loads((folder / name).read_text()) for name in RESULTS)
    assert result.best is not result.lowest, "the toy's random search must tell the two apart here"
    assert result.best is likeliest(result.trials)
    assert result.lowest is lowest(result.trials)
    assert found["best"]["trial"] == found["identifiability"]["base"] == result.best.index
    assert found["best"]["parameters"] == parameters == dict(result.best.candidate)
    assert found["best_score"]["trial"] == result.lowest.index
    assert found["best_score"]["mape"] < found["best"]["mape"]
    scored = {event["index"] for event in read_events(folder) if event["event"] == "score"}
    assert scored == {0, result.best.index, result.lowest.index}
    run = read_run(folder)
    assert (run.best.index, run.lowest.index) == (result.best.index, result.lowest.index)
    assert run.best_metrics == result.best_metrics
    assert run.metrics_of(run.lowest) == result.lowest_metrics
    assert run.analysis is not None
    assert f"Simulation {run.lowest.index} has the lowest total MAPE" in render(run)


def test_a_run_that_is_taken_up_again_scores_nothing_twice(run_toy: RunToy, tmp_path: Path) -> None:
    whole = run_toy(rounds=1, simulations=10)
    events = (tmp_path / "run" / FILE_NAME).read_bytes()
    again = run_toy(rounds=1, simulations=10)
    assert (again.best_metrics, again.records) == (whole.best_metrics, whole.records)
    added = (tmp_path / "run" / FILE_NAME).read_bytes()[len(events) :]
    assert b'"event":"score"' not in added


@pytest.mark.slow
def test_an_interrupt_after_the_search_is_told_and_the_run_goes_on(
    run_toy: RunToy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    settings: dict[str, Any] = {"scaffold": toy_scaffold("least-squares"), "simulations": 40, "analysing": True}
    with monkeypatch.context() as patched:
        patched.setattr(after_search, "analyse", interrupted)
        first = run_toy(**settings)
    assert first.cut_short
    assert first.analysis is None
    assert after_search.NOT_ANALYSED in read_run(tmp_path / "run").notes
    second = run_toy(**settings)
    assert not second.cut_short
    assert second.status == first.status != "interrupted"
    assert second.analysis is not None
    assert second.analysis.budget == 40
    assert after_search.NOT_ANALYSED not in read_run(tmp_path / "run").notes


def test_an_analysis_that_was_made_is_kept_where_none_is_asked_for(run_toy: RunToy, tmp_path: Path) -> None:
    settings: dict[str, Any] = {"scaffold": toy_scaffold("least-squares"), "simulations": 40}
    made = run_toy(**settings, analysing=True).analysis
    assert made is not None
    again = run_toy(**settings, analysing=False).analysis
    assert again is not None
    assert again.as_json() == made.as_json()
    written = json.loads((tmp_path / "run" / "result.json").read_text())["identifiability"]
    assert PostFitAnalysis.from_json(written).as_json() == made.as_json()


def test_the_time_of_a_run_that_is_taken_up_again_is_summed(run_toy: RunToy, tmp_path: Path) -> None:
    first = run_toy(simulations=10).wall_s
    second, third = run_toy(simulations=10).wall_s, run_toy(simulations=10).wall_s
    assert first < second < third
    spent = [event["wall_s"] for event in read_events(tmp_path / "run") if event["event"] == "end"]
    assert (first, second, third) == tuple(np.cumsum(spent)), "what is reported is what the journal keeps"
    assert json.loads((tmp_path / "run" / "result.json").read_text())["wall_s"] == third


def executed(folder: Path, plugins: FadingLives, soon: list[RunResult]) -> RunResult:
    earlier = list(read_events(folder)) if (folder / FILE_NAME).exists() else []
    config = RunConfig(scaffold=toy_scaffold(), simulations=20, rounds=1, warm_up=0)
    with closing(Journal(folder)) as journal:
        if not earlier:
            journal.append("run", format=1, identity="x", config={}, versions={}, task={})
        recorder = Recorder(journal, earlier)
        run = Run(fading_task(), config, plugins, recorder, journal, folder, earlier, SILENT, True, soon.append)  # type: ignore[arg-type]
        return run.execute()


@pytest.mark.slow
def test_a_life_is_forecast_before_its_analysis_which_may_be_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    first, soon = FadingLives(), list[RunResult]()
    with monkeypatch.context() as patched:
        patched.setattr(after_search, "analyse", interrupted)
        stopped = executed(tmp_path, first, soon)
    (early,) = soon
    assert early.held_out[0].curve is not None
    assert early.analysis is None
    assert not early.cut_short
    assert stopped.cut_short
    assert [one.as_json() for one in stopped.held_out] == [one.as_json() for one in early.held_out]

    second, later = FadingLives(), list[RunResult]()
    whole = executed(tmp_path, second, later)
    assert not later
    assert whole.analysis is not None
    assert early.held_out[0].fade is None
    assert whole.held_out[0].fade is not None
    # Its band takes more simulations, but not the forecast again.
    assert (first.exact, second.exact) == (1, 0)
    assert second.made > 0


def test_a_forecast_goes_on_in_the_middle_of_its_band(tmp_path: Path) -> None:
    """A life takes minutes to simulate: what was simulated before an interrupt is not simulated again."""
    task = fading_task()
    best = trial(1, 1.0, 1.0)
    best = replace(best, candidate={"rate": 0.2, "other": 0.5}, metrics=SignalMetrics(1.0, {}))
    draws = tuple((0.2 + 0.01 * shift, 0.5) for shift in (-1.0, 1.0))
    analysis = PostFitAnalysis(1, Identifiability({}, (), (), 1.0, 10, draws=draws))

    with closing(Journal(tmp_path)) as journal:
        journal.append("run", format=1, identity="x", config={}, versions={}, task={})

    def predicted(simulating: FadingLives) -> tuple[Any, ...]:
        earlier = list(read_events(tmp_path))
        with closing(Journal(tmp_path)) as journal:
            return AfterSearch(task, simulating, journal, earlier).predict(best, analysis)  # type: ignore[arg-type]

    first, second = FadingLives(2), FadingLives(10)
    assert predicted(first) == ()
    assert first.exact == 1
    (found,) = predicted(second)
    assert second.exact == 0
    assert (first.made, second.made) == (2, 1)  # the fit's life and one for each draw
    assert found.fade is not None
    assert found.fade.half_ah[-1] == pytest.approx(float(student.ppf(0.975, 2)) * 0.01, rel=1e-6)


@pytest.mark.slow
def test_a_life_is_simulated_once_with_reference_accuracy(tmp_path: Path) -> None:
    plugins = FadingLives()
    result = executed(tmp_path, plugins, [])
    assert result.analysis is not None
    # The start and the best: the analysis takes the latter from its score.
    assert (plugins.scored, len(result.trials)) == (2, 2)
