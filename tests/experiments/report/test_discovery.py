"""The report of a discovery."""

from dataclasses import asdict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bsa.core.contracts.requests import MeasuredRecord
from bsa.core.discovery.closure import Closure
from bsa.core.discovery.localisation import LAYOUTS
from bsa.core.discovery.next_experiment import NextExperiment
from bsa.core.inference.observations import Observations, observe
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.report.discovery import _figure, _held_out
from bsa.experiments.report.templates import template


def observed_record() -> Observations:
    time = np.linspace(0.0, 3600.0, 61)
    record = Trajectory(time, np.ones(61), 4.0 - time / 3600.0, steps=(Step(StepKind.CC_DISCHARGE, 0, 61),))
    return observe(MeasuredRecord("a.csv", record))


def test_a_figure_claims_no_error_that_was_not_scored() -> None:
    observed = observed_record()
    figure = _figure("record-0", observed, observed.voltage + 0.01, observed.voltage + 0.001)
    assert figure.chart.description == "Measured and simulated voltage."


@pytest.mark.parametrize(("effects", "curves"), [((), 1), (("contact-resistance",), 2)])
def test_a_hold_out_record_is_drawn_before_and_after_the_effect_and_marked(effects: tuple[str], curves: int) -> None:
    observed = observed_record()
    best = SimpleNamespace(effects=effects, held_errors=(np.full(len(observed), 1e-3),))
    nearest = SimpleNamespace(held_errors=(np.full(len(observed), -0.01),))
    found: Any = SimpleNamespace(findings=SimpleNamespace(best=best, gap=SimpleNamespace(nearest=nearest)))
    problem: Any = SimpleNamespace(held_observations=[observed])
    (figure,) = _held_out(found, problem)
    voltage, residual = figure.chart.panels
    assert len(voltage.lines) == 1 + curves
    drawn = {float(point.split(",")[1]) for point in residual.lines[0].points.split()}
    assert list(drawn) == pytest.approx([float(residual.axis.pixels(10.0))], abs=0.06)
    shown = page(figures=[figure])
    assert "<h3>a.csv, held out</h3>" in shown
    assert "Held out: no more than its initial state of charge was fitted to this record." in shown
    nearest.held_errors = ()  # a hold-out record cannot be simulated
    assert _held_out(found, problem) == []


_ERRORS = ("final_rmse_mv", "base_rmse_mv", "closed")


def page(**given: Any) -> str:
    """The page of an answer that has no more than what is given."""
    place = {"by": "since step", "where": "rest", "rms_mv": 5.0, "bias_mv": 4.34, "z": 77.3, "share": 1.0}
    content: dict[str, Any] = {
        "verdict": "unexplained",
        "localisation": [place],
        "localisation_after": [place | {"rms_mv": 1.25}],
        "gap": dict.fromkeys((*_ERRORS, *(f"holdout_{name}" for name in _ERRORS), "noise_mv"), 1.0) | {"known_mv": 0.0},
    }
    lists: dict[str, Any] = {name: [] for name in ("effects", "partial", "notes", "in_words", "candidates")}
    unset = lists | dict.fromkeys(("next_experiment", "closure", "backend_ranking"))
    numbers = {
        "simulations": 1,
        "wall_s": 1.0,
        "mesh_correction_mv": 0.0,
        "false_alarm_rate": 0.01,
        "capacity_ah": 1.85,
    }
    content |= unset | numbers | {"headline": "", "reason": "", "temperature_rms_k": {}} | given.pop("d", {})
    shown = {"d": content, "layouts": LAYOUTS, "figures": [], "with_effect": False, "base": [], "untried": ""}
    return template("record_discovery.html.j2").render(**shown | given)


def test_the_map_has_one_sign_and_no_effect_where_none_was_found() -> None:
    without = page()
    assert '4.34</td><td class="n">77.3</td>' in without
    assert "rms with the effect" not in without
    assert "1.25" not in without
    assert "rms with the effect" in page(with_effect=True)
    assert "1.25" in page(with_effect=True)


def test_a_proposed_experiment_says_where_it_starts_and_a_correction_what_it_is_over() -> None:
    proposed = NextExperiment("short pulses", ("Rest for 5 minutes",), 0.6, 1.0, 2.0, ("a", "b"), True)
    assert "short pulses, from a state of charge of 60 % (1C is 1.85 A): the two" in page(
        d={"next_experiment": asdict(proposed)}
    )
    closure = asdict(Closure(("1",), (1.0,), 24.53, 4.0))
    assert "24.53 mV before" in page(d={"closure": closure})
    assert "Both are over averages of samples" in page(d={"closure": closure})


def test_what_an_effect_explains_is_said_of_the_errors_and_of_their_squares() -> None:
    gap = {"base_rmse_mv": 105.63, "final_rmse_mv": 25.44, "closed": 0.94201, "noise_mv": 0.18, "known_mv": 0.0}
    gap |= {"holdout_base_rmse_mv": 566.99, "holdout_final_rmse_mv": 14.62, "holdout_closed": 0.999335}
    shown = page(d={"gap": gap}, with_effect=True)
    assert "from 105.63 mV (−76 %); 94 % of the squared misfit beyond noise is explained" in shown
    assert "from 566.99 mV (−97 %); 99.9 % of the squared misfit" in shown
    worse = page(d={"gap": gap | {"holdout_final_rmse_mv": 600.0, "holdout_closed": -0.12}}, with_effect=True)
    assert "from 566.99 mV (+6 %)</dd>" in worse
    assert page(d={"gap": gap}).count("of the fitted base model</dd>") == 2


def test_what_the_run_of_the_base_model_left_stands_beside_the_noise() -> None:
    assert "Left by the run" not in page()
    gap = {"base_rmse_mv": 19.2, "final_rmse_mv": 12.3, "closed": 0.75, "noise_mv": 0.1, "known_mv": 8.76}
    gap |= {"holdout_base_rmse_mv": 20.0, "holdout_final_rmse_mv": 12.0, "holdout_closed": 0.8}
    shown = page(d={"gap": gap}, with_effect=True)
    assert "75 % of the squared misfit beyond noise and what the run left is explained" in shown
    assert '8.76 <small>mV</small></dd><dd class="from">that the base model comes from' in shown


def test_the_map_says_what_each_part_is_laid_out_by_and_what_1c_is() -> None:
    assert "By time since the last step" in page()
    assert "1C is 1.85 A" in page()


def test_only_a_backend_that_was_asked_has_a_column() -> None:
    ranking = {"analysis": "", "note": "", "ranked": []}
    assert "Backend's rank" not in page()
    assert "Backend's rank" in page(d={"backend_ranking": ranking})
