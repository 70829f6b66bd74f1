"""What the records fix after a run, on a cell whose derivatives stand on paper."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bsa.core.ageing.fade_band import FadeBand
from bsa.core.inference.derivatives import known_derivatives
from bsa.core.inference.identifiability import Interval, effective_noise, unsettled
from bsa.core.inference.measure_next import Suggestion
from bsa.core.inference.post_fit_analysis import PostFitAnalysis
from bsa.core.parameters import ParameterSpace
from bsa.core.run.event_shapes import check_event
from bsa.core.run.journal import FILE_NAME, read_events
from bsa.core.run.loop import RunResult
from bsa.experiments.run_record import read_run
from bsa_toy_cell import (
    CAPACITY,
    CURRENT_A,
    EMPTY_V,
    FULL_V,
    HIDDEN,
    POLARISATION,
    RELAXATION,
    SERIES,
    space,
    toy_scaffold,
    toy_task,
)

RunToy = Callable[..., RunResult]

POINTS = np.linspace(0.0, 1.0, 16)


def jacobian_on_paper(candidate: dict[str, float], end: float) -> np.ndarray:
    """Derivatives of the toy's residuals in the unit box: those at a fixed end, and through the end's own shift."""
    slope = CURRENT_A * (FULL_V - EMPTY_V) / (3600.0 * candidate[CAPACITY])
    pol, tau = candidate[POLARISATION], candidate[RELAXATION]

    def partial(t: np.ndarray) -> dict[str, np.ndarray]:
        return {
            CAPACITY: slope * t / candidate[CAPACITY],
            SERIES: -np.ones_like(t),
            POLARISATION: -(1 - np.exp(-t / tau)),
            RELAXATION: pol * t / tau**2 * np.exp(-t / tau),
        }

    def falling(t: np.ndarray) -> np.ndarray:
        return -slope - pol / tau * np.exp(-t / tau)

    last = np.array(end)
    rest = 600.0 * POINTS
    columns = []
    for parameter in space():
        name = parameter.name
        d_end = -float(partial(last)[name]) / float(falling(last))
        loaded = partial(POINTS * end)[name] + falling(POINTS * end) * POINTS * d_end
        relaxed = {
            CAPACITY: np.full(16, slope * end / candidate[CAPACITY]),
            SERIES: np.zeros(16),
            POLARISATION: -(1 - np.exp(-end / tau)) * np.exp(-rest / tau),
            RELAXATION: pol * np.exp(-rest / tau) * (end / tau**2 * np.exp(-end / tau))
            - pol * (1 - np.exp(-end / tau)) * np.exp(-rest / tau) * rest / tau**2,
        }[name]
        shift = -slope - pol / tau * np.exp(-end / tau) * np.exp(-rest / tau)
        rows = np.concatenate(
            [np.zeros(17), loaded / 1e-3, [d_end / (end + 5.0) / 1e-3], (relaxed + shift * d_end) / 1e-3, [0.0]]
        )
        columns.append(rows * candidate[name] * np.log(parameter.upper / parameter.lower))
    return np.array(columns).T


def fitted(run_toy: RunToy, folder: Path, name: str = "least-squares", **more: object) -> RunResult:
    return run_toy(folder, scaffold=toy_scaffold(name), simulations=60, rounds=60, warm_up=0, analysing=True, **more)


@pytest.mark.slow
def test_the_intervals_are_those_on_paper(run_toy: RunToy, tmp_path: Path) -> None:
    result = fitted(run_toy, tmp_path)
    analysis = result.analysis
    assert analysis is not None
    best = result.best
    assert best.curves[0] is not None
    (_, discharge, _) = [piece for _, piece in best.curves[0].pieces()]
    exact = jacobian_on_paper(dict(best.candidate), discharge.duration)
    # Each of the three steps has sixteen voltages and its duration.
    deviation = np.tile([0.3] * 16 + [1.0], 3)
    weighed = exact / deviation[:, None]
    covariance = np.linalg.inv(weighed.T @ weighed + 12.0 * np.eye(4))
    from scipy.stats import t as student

    half = student.ppf(0.975, len(exact) - 4) * np.sqrt(np.diag(covariance))
    found = analysis.identifiability
    assert found.noise == pytest.approx(np.sqrt(np.mean(deviation**2)), rel=1e-4)
    assert [found.intervals[name].share_of_range for name in space().names] == pytest.approx(half, rel=0.1)
    # A residual that is told three times as well as another counts nine times as much.
    singular = np.linalg.svd(weighed * np.sqrt(np.mean(deviation**2)), compute_uv=False)
    assert [combination.singular_value for combination in found.combinations] == pytest.approx(singular, rel=0.03)
    for name, value in HIDDEN.items():
        assert found.intervals[name].lower <= value <= found.intervals[name].upper, name
    assert analysis.unsettled == ()


@pytest.mark.slow
def test_priors_narrow_the_intervals_of_a_search_that_weighed_them(run_toy: RunToy, tmp_path: Path) -> None:
    plain = toy_task()
    known = [
        replace(parameter, deviation=1e-4, prior=True) if parameter.name == SERIES else parameter
        for parameter in plain.space
    ]
    task = replace(plain, space=ParameterSpace(tuple(known)))
    deaf = fitted(run_toy, tmp_path / "deaf", task=task).analysis
    weighing = fitted(run_toy, tmp_path / "weighing", "staged", task=task).analysis
    assert deaf is not None
    assert weighing is not None
    # On a log scale 95 % of the prior lie within two times its deviation, as a share of the range.
    (series,) = [parameter for parameter in plain.space if parameter.name == SERIES]
    share = 1.96e-4 / np.log(series.upper / series.lower)
    assert deaf.identifiability.intervals[SERIES].share_of_range > 2.0 * share
    assert weighing.identifiability.intervals[SERIES].share_of_range < 1.2 * share


@pytest.mark.slow
def test_simulations_after_the_search_are_not_the_searchs(run_toy: RunToy, tmp_path: Path) -> None:
    plain = run_toy(tmp_path / "plain", scaffold=toy_scaffold("least-squares"), simulations=60, rounds=60, warm_up=0)
    looked = fitted(run_toy, tmp_path / "looked")
    assert [dict(trial.candidate) for trial in plain.trials] == [dict(trial.candidate) for trial in looked.trials]
    assert plain.analysis is None
    assert looked.analysis is not None
    # Of the four derivatives those that the search has shown are not simulated again.
    assert looked.analysis.simulations >= 4 - looked.analysis.reused
    content = json.loads((tmp_path / "looked" / "result.json").read_text())
    assert content["simulations"] == len(plain.trials)
    assert content["identifiability_simulations"] == looked.analysis.simulations
    assert PostFitAnalysis.from_json(content["identifiability"]) == looked.analysis
    assert read_run(tmp_path / "looked").analysis == looked.analysis
    for name in ("simulations", "reused", "seconds", "budget", "widened", "forgone"):
        with pytest.raises(ValueError, match=f'"{name}"'):
            PostFitAnalysis.from_json({**content["identifiability"], name: None})


@pytest.mark.slow
def test_an_analysis_cut_off_anywhere_goes_on_from_what_was_simulated(run_toy: RunToy, tmp_path: Path) -> None:
    # Its fit is taken from afar, so that no derivative is known from the search.
    def looked(folder: Path) -> RunResult:
        return run_toy(folder, scaffold=toy_scaffold("random"), simulations=6, rounds=6, warm_up=0, analysing=True)

    whole = looked(tmp_path / "whole").analysis
    assert whole is not None
    lines = (tmp_path / "whole" / FILE_NAME).read_bytes().splitlines(keepends=True)
    places = [place for place, line in enumerate(lines) if b'"event":"appraisal-simulation"' in line]
    assert len(places) >= 4
    # Every seventh: before, within and after each of the rounds of simulations.
    for kept in (*places[::7], places[-1] + 1):
        folder = tmp_path / f"cut-{kept}"
        folder.mkdir()
        (folder / FILE_NAME).write_bytes(b"".join(lines[:kept]))
        again = looked(folder).analysis
        assert again is not None
        # The time of a simulation is all that differs between two.
        assert replace(again, seconds=0.0) == replace(whole, seconds=0.0)
        written = (folder / FILE_NAME).read_bytes().splitlines(keepends=True)
        found = [line for line in written if b'"event":"appraisal-simulation"' in line]
        assert len(found) == len(places)
        before = [lines[place] for place in places if place < kept]
        assert found[: len(before)] == before


def test_derivatives_that_the_search_has_taken_are_used(run_toy: RunToy, tmp_path: Path) -> None:
    result = run_toy(tmp_path, scaffold=toy_scaffold("least-squares"), simulations=5, rounds=5, warm_up=0)
    start = result.trials[0]
    known = known_derivatives(result.trials, start, space())
    assert sorted(known) == [0, 1, 2, 3]
    assert start.curves[0] is not None
    duration = start.curves[0].slice(2, 62).duration
    exact = jacobian_on_paper(dict(start.candidate), duration)
    found = np.column_stack([known[place] for place in range(4)])
    assert np.linalg.norm(found - exact) < 0.02 * np.linalg.norm(exact)
    far = result.trials[1]
    moved = {**start.candidate, CAPACITY: 2.5}
    from dataclasses import replace

    assert known_derivatives([start, far], replace(start, candidate=moved), space()) == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["full", "hybrid", "cma-es"])
def test_any_scaffold_can_be_judged_and_a_resumed_run_says_the_same(run_toy: RunToy, tmp_path: Path, name: str) -> None:
    result = fitted(run_toy, tmp_path / "whole", name)
    assert result.analysis is not None
    lines = (tmp_path / "whole" / "journal.jsonl").read_bytes().splitlines(keepends=True)
    last = next(number for number, line in enumerate(lines) if b'"event":"appraisal"' in line)
    for kept in (last - 3, last, last + 1):
        folder = tmp_path / f"cut-{kept}"
        folder.mkdir()
        (folder / "journal.jsonl").write_bytes(b"".join(lines[:kept]))
        assert fitted(run_toy, folder, name).analysis == result.analysis
        assert sum(event["event"] == "appraisal" for event in read_events(folder)) == 1


@pytest.mark.slow
def test_the_next_measurement_is_the_most_telling_of_those_a_simulator_offers(run_toy: RunToy, tmp_path: Path) -> None:
    result = fitted(run_toy, tmp_path)
    assert result.analysis is not None
    # Everything is fixed: there is nothing left to measure.
    assert result.analysis.identifiability.open == ()
    assert result.analysis.measure_next == ()

    from bsa_toy_cell import toy_task

    shy = toy_task({**HIDDEN, SERIES: 0.0052, POLARISATION: 0.0052})
    looked = fitted(run_toy, tmp_path / "shy", task=shy).analysis
    assert looked is not None
    before = looked.identifiability.intervals[looked.worst].share_of_range
    names = [suggestion.name for suggestion in looked.measure_next]
    assert names[0] == "discharge at 4 A"
    assert names[-1] == "discharge at 0.1 A"
    assert looked.measure_next[0].worst_share_of_range < 0.6 * before
    assert looked.measure_next[0].hours < looked.measure_next[-1].hours


WRITTEN = (
    '{"event":"appraisal","appraisal":{"intervals":{"R":{"value":0.1,"lower":0.0,"upper":0.3,"share_of_range":0.4,'
    '"verdict":"open"}},"combinations":[{"weights":{"R":1.0},"singular_value":12.0,"share_of_range":0.4,"verdict":'
    '"open"}],"correlated":[["R","C"]],"noise":1.5,"points":40,"covariance":[[0.04]],"draws":[[0.2]],'
    '"singular_values":[12.0],"base":7,"unknown":["C"],"unsettled":["R"],"worst":"R","measure_next":[{"name":'
    '"C/20 discharge","protocol":[["Discharge at C/20 until 2.5 V","Rest for 1 h"]],"hours":20.5,"worst":"R",'
    '"worst_share_of_range":0.1,"shares_of_range":{"R":0.1,"C":0.05}}],"simulations":30,"reused":2,"seconds":4.5,'
    '"fade":[{"cycle":[1.0,100.0],"half_ah":[0.01,0.02]}],"budget":60,"widened":1.0,"cut_short":false,"forgone":0}}'
)
"""An event as journals of earlier versions have it, to the letter."""


def test_an_analysis_is_read_from_journals_and_written_to_them_as_ever() -> None:
    check_event("appraisal", WRITTEN.encode())
    read = PostFitAnalysis.from_json(json.loads(WRITTEN)["appraisal"])
    (suggestion,) = read.measure_next
    assert suggestion == Suggestion(
        "C/20 discharge",
        (("Discharge at C/20 until 2.5 V", "Rest for 1 h"),),
        20.5,
        "R",
        0.1,
        {"R": 0.1, "C": 0.05},
    )
    assert read.identifiability.intervals == {"R": Interval(0.1, 0.0, 0.3, 0.4, "open")}
    assert (read.base, read.unknown, read.fade) == (7, ("C",), (FadeBand((1.0, 100.0), (0.01, 0.02)),))
    event = {"event": "appraisal", "appraisal": read.as_json()}
    assert json.dumps(event, separators=(",", ":")) == WRITTEN


def test_an_analysis_of_a_journal_that_does_not_have_all_of_it_is_read() -> None:
    content = json.loads(WRITTEN)["appraisal"]
    later = ("covariance", "draws", "singular_values", "fade", "budget", "widened", "cut_short", "forgone")
    early = {name: value for name, value in content.items() if name not in later}
    check_event("appraisal", json.dumps({"event": "appraisal", "appraisal": early}).encode())
    read = PostFitAnalysis.from_json(early)
    assert (read.identifiability.covariance, read.identifiability.draws, read.fade) == ((), (), ())
    assert (read.budget, read.widened, read.cut_short, read.forgone) == (0, 1.0, True, 0)


def test_a_run_in_which_nothing_simulates_is_not_judged(run_toy: RunToy, tmp_path: Path) -> None:
    broken = toy_scaffold("least-squares", simulator={"use": "toy-cell", "options": {"breaks_above_ohm": 0.0}})
    result = run_toy(tmp_path, scaffold=broken, simulations=12, analysing=True)
    assert result.analysis is None


@pytest.mark.slow
def test_a_search_that_ends_by_itself_leaves_the_analysis_what_it_was_allowed(run_toy: RunToy, tmp_path: Path) -> None:
    result = fitted(run_toy, tmp_path)
    assert len(result.trials) < 60
    assert result.analysis is not None
    assert result.analysis.budget == 60
    assert result.analysis.forgone == 0


@pytest.mark.slow
def test_a_fit_that_stopped_short_says_so(run_toy: RunToy, tmp_path: Path) -> None:
    result = run_toy(
        tmp_path, scaffold=toy_scaffold("least-squares"), simulations=5, rounds=5, warm_up=0, analysing=True
    )
    assert result.analysis is not None
    assert CAPACITY in result.analysis.unsettled
    report = (tmp_path / "report.html").read_text()
    # Further records would take more simulations than the search was allowed.
    assert result.analysis.budget == 5
    assert result.analysis.forgone > 0
    assert "What to measure next was not looked for" in report
    assert "The fit has not settled" in report
    assert report.count(", not settled") == len(result.analysis.unsettled)


def test_a_misfit_that_follows_the_curve_widens_the_noise() -> None:
    rng = np.random.default_rng(3)
    white = rng.normal(size=400)
    smooth = np.convolve(rng.normal(size=440), np.ones(40) / np.sqrt(40), "valid")[:400]
    assert effective_noise(white, 3, 0.0) == pytest.approx(1.0, rel=0.12)
    assert effective_noise(smooth, 3, 0.0) > 4.0
    assert effective_noise(1e-6 * smooth, 3, 1.0) == 1.0
    assert unsettled(np.eye(3), np.zeros(3), 0.0, ("a", "b", "c"), np.full(3, 0.5)) == ()
