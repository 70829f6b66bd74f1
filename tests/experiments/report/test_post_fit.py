"""What a fit fixes, in words."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bsa.core.cell import CELL, SPECTRUM
from bsa.core.comparison.paper_metrics import PaperMetrics
from bsa.core.comparison.signal_metrics import SignalMetrics
from bsa.core.comparison.spectrum_record import spectrum_record
from bsa.core.feedback import Feedback
from bsa.core.inference.identifiability import Identifiability, Interval
from bsa.core.inference.post_fit_analysis import PostFitAnalysis
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.spectrum import ImpedanceSpectrum
from bsa.core.target import Value
from bsa.core.task import CellModel, Experiment, Protocol, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.core.trial import Trial
from bsa.experiments.report.post_fit import (
    best_score_line,
    caution_line,
    ended_by_itself,
    needs_more,
    tolerance_words,
    verdict_line,
)


@pytest.mark.parametrize(
    ("protocol", "spectrum", "expected"),
    [
        (None, False, "1 mV"),
        ((("Discharge at 1C",),), False, "1 mV, 0.1 % of a duration, about 1 % of the current"),
        (None, True, "1 mV of voltage, about 1 % of the impedance"),
    ],
)
def test_what_a_tolerance_is(protocol: Protocol | None, spectrum: bool, expected: str) -> None:
    time = np.linspace(0.0, 100.0, 11)
    record = Trajectory(time, np.ones(11), np.full(11, 3.7), steps=(Step(StepKind.CC_DISCHARGE, 0, 11),))
    experiments = [Experiment("v.csv", record, protocol)]
    if spectrum:
        z = ImpedanceSpectrum("z.csv", np.logspace(3, -2, 11), np.full(11, 0.02 - 1e-3j))
        experiments.append(Experiment("z.csv", spectrum_record(z)))
    space = ParameterSpace((Parameter("a", 1.0, 0.0, 2.0, target=Value("a")),))
    signals = (*CELL.signals, *SPECTRUM) if spectrum else ()
    assert tolerance_words(Task("t", CellModel(""), space, tuple(experiments), signals=signals)) == expected


def test_many_parameters_of_which_none_is_fixed_are_not_listed() -> None:
    verdicts = {"a": "open", "b": "open"}
    assert verdict_line(judged(verdicts)) == "The record fixes none of the 2 parameters: all are open."
    assert (
        verdict_line(judged({**verdicts, "c": "fixed"})) == "The record fixes 1 of 3 parameters: c; 2 are open: a, b."
    )
    many = {f"p{n}": "loose" for n in range(7)}
    assert verdict_line(judged({**many, "c": "fixed"})) == "The record fixes 1 of 8 parameters: c; 7 are loose."


def test_one_parameter_is_no_plural() -> None:
    assert verdict_line(judged({"a": "open"})) == "The record does not fix a: it is open."
    assert verdict_line(judged({"a": "loose"})) == "The record fixes 0 of 1 parameter; 1 is loose: a."


@pytest.mark.parametrize("verdicts", [{"a": "open", "b": "open"}, {"a": "fixed", "b": "open"}])
def test_an_analysis_that_did_not_converge_is_no_fact_about_the_record(verdicts: dict[str, Any]) -> None:
    line = verdict_line(replace(judged(verdicts), widened=44.0))
    assert line.startswith(
        "The analysis stopped before its sample converged, so intervals are wider than the record's."
    )
    assert "With them the record fixes" in line


@pytest.mark.parametrize(("widened", "said"), [(1.0, False), (1.005, False), (1.06, True), (44.0, True)])
def test_nothing_is_said_of_a_sample_that_was_widened_by_less_than_is_shown(widened: float, said: bool) -> None:
    found = replace(judged({"a": "fixed"}), widened=widened, simulations=22, budget=3)
    assert verdict_line(found).startswith("The record fixes 1 of 1") != said
    assert bool(caution_line(found)) == said
    assert needs_more(found) == said


def test_where_the_fit_has_not_settled_intervals_say_little_in_either_direction() -> None:
    both = replace(judged({"a": "open"}), widened=44.0, unsettled=("a",), simulations=22, budget=3)
    first = "The fit has not settled: a would move by more than the interval with another step"
    assert verdict_line(both).startswith(f"{first}, so the intervals say little in either direction.")
    said = f"{verdict_line(both)} {caution_line(both)}"
    assert said.count("has not settled") == 1
    assert (
        "sample of the parameters had converged; to allow for that, the assumed noise was multiplied by 44. W" in said
    )
    assert not any(words in said for words in ("wide", "narrow"))


def test_many_parameters_that_have_not_settled_are_counted() -> None:
    names = tuple("abcdefg")
    found = replace(judged(dict.fromkeys(names, "open")), unsettled=names)
    assert verdict_line(found).startswith("The fit has not settled: 7 of 7 parameters would move by more than")


def test_fitted_values_outside_their_intervals_are_named() -> None:
    found = judged({"a": "fixed", "b": "open"})
    outside = replace(found.identifiability.intervals["a"], lower=1.5)
    found = replace(found, identifiability=replace(found.identifiability, intervals={"a": outside}))
    assert verdict_line(found).startswith(
        "The fit stopped short of the likeliest values, about which the intervals lie: a is outside. "
    )


def test_an_analysis_beyond_its_budget_says_that_some_simulations_are_made_in_any_case() -> None:
    ended = replace(judged({"a": "open"}), widened=44.0, simulations=22, budget=3)
    beyond = "(more than the search may make, 3, it makes only where it cannot do without)"
    assert f"stopped after 22 simulations {beyond}, before its sample" in caution_line(ended)
    assert beyond not in caution_line(replace(ended, budget=30))


def test_an_analysis_whose_draws_never_came_out_as_predicted_says_so_and_advises_no_more_of_them() -> None:
    ended = replace(judged({"a": "open"}), widened=4.0, simulations=96, budget=300, cut_short=False)
    assert caution_line(ended).startswith("After 96 simulations of the analysis, as many as it makes, draws of the ")
    assert "multiplied by 4" in caution_line(ended)
    assert "With more --simulations" not in caution_line(ended)
    assert not needs_more(ended)


def test_a_run_says_by_what_its_values_were_chosen_over_those_with_the_lowest_error() -> None:
    """A record of one step of one signal: nothing is followed "more closely step by step" there."""
    task = one_record()
    best, lowest = tried(2, 20.26, 28.46), tried(27, 22.75, 25.58)
    metrics = PaperMetrics(25.58, 0.1, 0.0, 0.0, 0.1, 0.0, 25.58, 0.0, 0.0)
    assert best_score_line(task, best, lowest, metrics) == (
        "These are the values of simulation 2: the fit minimises the means of the error over parts of each "
        "step, which are 20.3 tolerances (rms) there and 22.8 in simulation 27, which has the lowest voltage RMSE, "
        "25.58 mV. One tolerance is 1 mV."
    )
    start = replace(best, phase="initial")
    assert "simulation 2 (the starting point): the fit" in best_score_line(task, start, lowest, metrics)
    assert best_score_line(task, best, best, metrics) == ""


def test_what_is_more_probable_for_its_priors_is_said_to_be_so() -> None:
    best, lowest = tried(2, 10.02, 15.0), tried(27, 9.91, 13.6)
    said = best_score_line(one_record(), best, lowest, PaperMetrics(13.6, 0.1, 0.0, 0.0, 0.1, 0.0, 13.6, 0.0, 0.0))
    assert said == (
        "These are the values of simulation 2, the most probable ones: simulation 27 has the lowest voltage RMSE, 13.6 "
        "mV, and a misfit of 9.91 in place of 10 tolerances (rms), but is farther from the priors of the search space. "
        "One tolerance is 1 mV."
    )


def test_where_misfit_and_score_chose_together_that_rule_is_told() -> None:
    driven = one_record()
    task = replace(driven, experiments=(replace(driven.experiments[0], protocol=(("Discharge at 1 A",),)),))
    best, lowest = tried(4, 27.4, 30.0), tried(1, 140.0, 13.75)
    said = best_score_line(task, best, lowest, PaperMetrics(13.75, 13.75, 0.0, 0.0, 13.75, 0.0, 1.0, 0.0, 0.0))
    assert said.startswith(
        "These are the values of simulation 4, which has the least product of misfit, 27.4 tolerances (rms), and total "
        "MAPE: "
    )
    assert "Simulation 1 has the lowest total MAPE, 13.75 %, and a misfit of 140. One tolerance is" in said
    assert "the fit minimises" not in said


def test_more_simulations_are_advised_where_an_analysis_lacks_them() -> None:
    found = judged({"a": "open"})
    assert not needs_more(found)
    for lacking in ({"unsettled": ("a",)}, {"widened": 2.0}, {"forgone": 12}):
        assert needs_more(replace(found, **lacking))


def test_a_fit_that_ended_by_itself_is_not_advised_more_simulations() -> None:
    """A measured cell's fit had ended after 138 of 300 simulations; with 600 allowed it made none more."""
    unsettled = replace(judged({"a": "open", "b": "loose"}), unsettled=("a",))
    apart = judged({"a": "fixed", "b": "open"})
    outside = replace(apart.identifiability.intervals["a"], lower=1.5)
    apart = replace(apart, identifiability=replace(apart.identifiability, intervals={"a": outside}))
    for found in (unsettled, apart):
        assert needs_more(found)
        assert "ore simulations, or" in verdict_line(found) or "go on with more simulations" in verdict_line(found)
        assert not needs_more(found, ended=True)
        assert "go on with" not in verdict_line(found, ended=True)
    assert "it would not use more simulations. Fewer searched parameters, or" in verdict_line(unsettled, ended=True)
    assert verdict_line(apart, ended=True).startswith("The fit stopped short of the likeliest values")
    assert "A run that begins elsewhere may come nearer." in verdict_line(apart, ended=True)
    assert needs_more(replace(unsettled, forgone=12), ended=True)
    assert ended_by_itself("finished", "")
    assert not ended_by_itself("finished", 'Stage "joint" is skipped.')
    assert not ended_by_itself("simulations-spent", "")


def tried(index: int, misfit: float, objective: float) -> Trial:
    metrics = SignalMetrics(objective, {})
    return Trial(index, "search", 1, {}, metrics, None, np.full(4, misfit), Feedback({}), (), 0.0)


def one_record() -> Task:
    time = np.linspace(0.0, 100.0, 11)
    record = Trajectory(time, np.ones(11), np.full(11, 3.7), steps=(Step(StepKind.CC_DISCHARGE, 0, 11),))
    space = ParameterSpace((Parameter("a", 1.0, 0.0, 2.0, target=Value("a")),))
    return Task("t", CellModel(""), space, (Experiment("v.csv", record),))


def judged(verdicts: dict[str, Any]) -> PostFitAnalysis:
    intervals = {name: Interval(1.0, 0.0, 2.0, 0.5, verdict) for name, verdict in verdicts.items()}
    return PostFitAnalysis(0, Identifiability(intervals, (), (), 1.0, 10))
