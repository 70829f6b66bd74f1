"""The figures of a life in a report."""

import re
from dataclasses import replace

import numpy as np
from bsa.core.ageing.cycle_table import LOSSES
from bsa.core.ageing.fade_band import FadeBand
from bsa.core.comparison.record_errors import RecordErrors, SignalError
from bsa.core.encoding import encode_proposal, encode_task, encode_trial
from bsa.core.feedback import Feedback
from bsa.core.inference.identifiability import Identifiability
from bsa.core.inference.post_fit_analysis import PostFitAnalysis
from bsa.core.inference.prediction import Band, Prediction
from bsa.core.metrics import evaluate
from bsa.core.proposal import Proposal
from bsa.core.run.journal import Journal
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import Task
from bsa.core.trajectory import Trajectory
from bsa.core.trial import Trial
from bsa.experiments.report.ageing import lives
from bsa.experiments.report.page import build_report
from bsa.experiments.run_record import read_run
from bsa_toy_life import life, life_task


def trial(task: Task, index: int, curve: Trajectory) -> Trial:
    metrics = evaluate(task, Outcome((ExperimentRun(curve),)))
    phase = "search" if index else "initial"
    return Trial(index, phase, index, task.space.initial, metrics, None, None, Feedback({}), (curve,), 1.0)


def with_losses(curve: Trajectory) -> Trajectory:
    assert curve.cycle_table is not None
    lost = np.linspace(0.0, 8.0, len(curve.cycle_table))
    columns = {LOSSES[0]: lost, LOSSES[1]: 0.25 * lost, LOSSES[2]: 0.0 * lost}
    return replace(curve, cycle_table=replace(curve.cycle_table, **columns))


def run_of(tmp_path, *curves: Trajectory):  # type: ignore[no-untyped-def]
    task = life_task(life(200, 0.2, bend=4.0))
    journal = Journal(tmp_path)
    config = {"scaffold": {"name": "full"}, "backend": "rules", "seed": 1}
    journal.append("run", format=1, identity="x", config=config, versions={}, task=encode_task(task))
    for index, curve in enumerate(curves):
        made = trial(task, index, curve)
        if index:
            proposal = Proposal((made.candidate,))
            journal.append("proposal", phase="search", round=index, **encode_proposal(proposal))
        journal.append("trial", **encode_trial(made, tmp_path))
    journal.close()
    return read_run(tmp_path)


def test_a_life_shows_fade_losses_and_the_cycles_that_were_compared(tmp_path) -> None:  # type: ignore[no-untyped-def]
    run = run_of(tmp_path, life(200, 0.1, bend=4.0), with_losses(life(200, 0.19, bend=4.0)))
    [drawn] = lives(run)
    labels = [panel.label for panel in drawn.chart.panels]
    assert labels == ["Capacity / A h", "Resistance / Ω", "Lost / %"]
    assert [line.style for line in drawn.chart.panels[0].lines] == ["measured", "initial", "best"]
    assert len(drawn.chart.panels[0].markers) == len(run.task.experiments[0].detailed_cycles)
    # A loss that is none is not drawn.
    assert len(drawn.chart.panels[2].lines) == 2
    assert "8 % of the lithium, 2 % of the negative material" in drawn.remark
    assert "turns steeper" in drawn.remark
    assert "off by 1 % at most" in drawn.remark


def test_the_page_lays_over_the_first_cycle_the_knee_and_the_last(tmp_path) -> None:  # type: ignore[no-untyped-def]
    run_of(tmp_path, life(200, 0.1, bend=4.0), life(200, 0.2, bend=4.0))
    page = build_report(tmp_path).read_text(encoding="utf-8")
    assert "The life" in page
    assert "cycle 1<" in page
    assert "cycle 200<" in page
    assert len(set(re.findall(r'id="overlay-0-(\d+)-title"', page))) == 3


def test_a_simulation_that_told_nothing_leaves_the_measured_life(tmp_path) -> None:  # type: ignore[no-untyped-def]
    short = life(200, 0.1)
    run = run_of(tmp_path, replace(short, cycle_table=None))
    [drawn] = lives(run)
    assert [line.style for line in drawn.chart.panels[0].lines] == ["measured"]
    assert "best simulation" not in drawn.remark


def test_a_forecast_is_drawn_behind_the_fit_with_its_band(tmp_path) -> None:  # type: ignore[no-untyped-def]
    run = run_of(tmp_path, life(200, 0.1), life(200, 0.2))
    fitted, whole = run.task.experiments[0], life(300, 0.3)
    assert whole.cycle_table is not None
    later = replace(fitted, name="life, cycles 201 to 300", target=whole, detailed_cycles=whole.cycles)
    later = replace(later, protocol=fitted.protocol + fitted.protocol[:100])
    errors = RecordErrors(later.name, {"capacity": SignalError("%", 1.5, 3.0, 1.4)})
    fade = FadeBand(tuple(whole.cycle_table.cycle), (0.02,) * 300)
    prediction = Prediction(errors, {"capacity": Band(2.0, 2.0, 0.9)}, whole, 0, fade)
    task = replace(run.task, experiments=(replace(fitted, name="life, cycles 1 to 200"),), held_out=(later,))
    [drawn] = lives(replace(run, task=task, held_out=(prediction,)))
    styles = [line.style for line in drawn.chart.panels[0].lines]
    assert sorted(styles) == ["best", "initial", "limit", "limit", "measured", "measured"]
    assert [band.label for band in drawn.chart.bands] == ["not fitted"]
    assert "off by 1.5 % of the first capacity rms" in drawn.remark
    assert "holds 90 % of them" in drawn.remark


def test_the_band_of_a_fit_is_drawn_about_its_best_simulation(tmp_path) -> None:  # type: ignore[no-untyped-def]
    run = run_of(tmp_path, life(200, 0.1), life(200, 0.2))
    known = Identifiability({}, (), (), 1.0, 10)
    analysis = PostFitAnalysis(1, known, fade=(FadeBand((1.0, 200.0), (0.01, 0.15)),))
    [drawn] = lives(replace(run, analysis=PostFitAnalysis.from_json(analysis.as_json())))
    assert [line.style for line in drawn.chart.panels[0].lines].count("limit") == 2
    assert any(key.label == "95 % band of a single cycle" for key in drawn.chart.keys)
    # The panel holds the band, whose lower edge ends at 0.9 - 0.15 A h, below all curves.
    assert drawn.chart.panels[0].axis.low < 0.75
