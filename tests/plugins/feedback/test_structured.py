import json
from pathlib import Path

import pytest
from bsa.core.hooks import NoOptions, RunContext
from bsa.core.metrics import evaluate
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task import Task
from bsa.plugins.feedback.features import mismatches
from bsa.plugins.feedback.overlay import OverlayFeedback
from bsa.plugins.feedback.rounding import rounded
from bsa.plugins.feedback.structured import ScalarFeedback, StructuredFeedback
from bsa_toy_cell import CAPACITY, HIDDEN, SERIES, record, toy_task


def features(task: Task, outcome: Outcome) -> dict[str, float]:
    return {name: found.value for name, found in mismatches(task, outcome).items()}


def outcome(**changes: float) -> Outcome:
    return Outcome((ExperimentRun(record({**HIDDEN, **changes})),))


def failed() -> Outcome:
    part = record(HIDDEN).slice(0, 2)
    return Outcome((ExperimentRun(part, SimulationFailure("Minimum voltage", "Discharge at 1 A", 1, 60.0)),))


@pytest.fixture
def context(tmp_path: Path) -> RunContext:
    return RunContext(toy_task(), 1, tmp_path)


def test_a_smaller_cell_discharges_too_short() -> None:
    found = features(toy_task(), outcome(**{CAPACITY: 0.9 * HIDDEN[CAPACITY]}))
    lost = record(HIDDEN).duration - record({**HIDDEN, CAPACITY: 0.9 * HIDDEN[CAPACITY]}).duration
    assert found["cc_discharge_time_mismatch_s"] == pytest.approx(-lost)


def test_a_resistance_lowers_the_discharge_early_by_current_times_resistance() -> None:
    found = features(toy_task(), outcome(**{SERIES: HIDDEN[SERIES] + 0.02}))
    # At equal fractions of a shorter discharge less charge is gone, which gives a little back.
    assert -20.0 < found["cc_discharge_early_shift_mv"] < -12.0


def test_a_match_has_no_mismatch() -> None:
    assert max(map(abs, features(toy_task(), outcome()).values())) < 1e-9


def test_a_failed_simulation_tells_how_far_it_came(context: RunContext) -> None:
    content = StructuredFeedback(NoOptions(), context).build_feedback(failed(), None, 0).content
    assert content["residuals"] == {}
    assert content["features"] == {}
    assert content["events"][0] == "simulation_failed: Minimum voltage"
    assert "stopped in cycle 1 during: Discharge at 1 A" in content["events"]
    assert "reached 60 s" in content["events"][2]


def test_the_package_is_compact_json(context: RunContext) -> None:
    result = outcome(**{CAPACITY: 1.0})
    content = StructuredFeedback(NoOptions(), context).build_feedback(result, evaluate(toy_task(), result), 0).content
    assert len(json.dumps(content)) < 1400
    assert content["residuals"]["total_mape_pct"] > 0


def test_scalar_feedback_is_one_number(context: RunContext) -> None:
    result = outcome(**{CAPACITY: 1.0})
    content = ScalarFeedback(NoOptions(), context).build_feedback(result, evaluate(toy_task(), result), 0).content
    assert list(content["residuals"]) == ["total_mape_pct"]
    assert "features" not in content


def test_an_overlay_is_a_png_in_the_run_folder(context: RunContext) -> None:
    result = outcome(**{CAPACITY: 1.0})
    feedback = OverlayFeedback(NoOptions(), context).build_feedback(result, evaluate(toy_task(), result), 7)
    (image,) = feedback.images
    assert image == context.folder / "overlays" / "trial-007.png"
    assert image.read_bytes().startswith(b"\x89PNG")


def test_rounding_leaves_json_that_every_parser_reads() -> None:
    assert rounded({"a": 1.23456789, "b": [float("nan"), 3], "c": True}) == {"a": 1.235, "b": [None, 3], "c": True}
