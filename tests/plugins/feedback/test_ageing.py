"""Feedback on long records, of a size that does not depend on their length."""

import json
from dataclasses import replace

import pytest
from bsa.core.ageing.choice import SHOWN
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task import Task
from bsa.plugins.feedback.ageing import cycles_in_detail, fade_features, measured_life, told_cycles
from bsa.plugins.feedback.features import mismatches
from bsa_toy_life import life, life_task


def features(task: Task, outcome: Outcome) -> dict[str, float]:
    return {name: found.value for name, found in mismatches(task, outcome).items()}


def told(count: int, lost: float) -> dict[str, float]:
    return features(life_task(life(count, 0.2)), Outcome((ExperimentRun(life(count, lost)),)))


def test_features_tell_the_fade_and_the_steps_of_the_cycles_that_bend_it() -> None:
    found = told(200, 0.1)
    assert found["fade_mismatch_pct"] == pytest.approx(-10.0)
    assert found["capacity_mismatch_cycle_1_pct"] == pytest.approx(0.0, abs=1e-9)
    assert found["capacity_mismatch_cycle_200_pct"] == pytest.approx(12.5)
    assert found["resistance_mismatch_cycle_200_pct"] == pytest.approx(100 * (1.1 / 1.2 - 1))
    assert found["cycle_200_cc_discharge_time_mismatch_s"] == pytest.approx(360.0)
    assert "cycle_1_cc_charge_middle_shift_mv" in found
    assert {int(name.split("_")[1]) for name in found if name.startswith("cycle_")} == {1, 66, 200}


def test_features_have_the_same_names_in_every_trial() -> None:
    assert list(told(200, 0.1)) == list(told(200, 0.3))


def test_the_knee_of_the_record_is_told() -> None:
    target = life(200, 0.2, bend=4.0)
    assert told_cycles(life_task(target).experiments[0])[1] in range(80, 170)
    assert "knee_at_cycle" in measured_life(life_task(target).experiments[0])


@pytest.mark.parametrize("count", [40, 2000])
def test_no_more_is_told_of_a_longer_life(count: int) -> None:
    made = life_task(life(count, 0.2, bend=4.0))
    detail = cycles_in_detail(made, (life(count, 0.1),), asked=tuple(range(1, count)))
    assert len(detail[0]["cycles"]) <= SHOWN
    assert len(json.dumps(detail)) < 4000
    assert len(json.dumps(measured_life(made.experiments[0]))) < 1000
    assert len(told(count, 0.1)) <= 40


def test_the_cycles_in_detail_say_why_they_are_shown() -> None:
    [detail] = cycles_in_detail(life_task(life(200, 0.2)), (life(200, 0.1),), asked=(40,))
    reasons = {entry["cycle"]: entry["shown_because"] for entry in detail["cycles"]}
    assert reasons[38] == "asked for (40)"
    assert "largest capacity mismatch" in reasons[200]
    last = detail["cycles"][-1]["steps"][-1]
    assert (last["measured_s"], last["simulated_s"]) == pytest.approx((2880.0, 3240.0))
    assert last["voltage_shift_mv"] == pytest.approx(2.0)


def test_a_life_that_ended_early_tells_what_it_reached() -> None:
    whole = life(200, 0.1)
    assert whole.cycle_table is not None
    part = replace(whole, cycle_table=whole.cycle_table.up_to(120))
    record = life_task(life(200, 0.2)).experiments[0]
    found = fade_features(ExperimentRun(part, SimulationFailure("it stopped", cycle=121)), record)
    assert "capacity_mismatch_cycle_101_pct" in found
    assert "capacity_mismatch_cycle_200_pct" not in found
    assert "fade_mismatch_pct" not in found
    # One that ran to its end lacks the cycles in which its cell gave no charge any more.
    found = fade_features(ExperimentRun(part), record)
    assert found["capacity_mismatch_cycle_200_pct"][0] == pytest.approx(-100.0)
    assert found["fade_mismatch_pct"][0] == pytest.approx(80.0)
    assert fade_features(ExperimentRun(None), life_task(whole).experiments[0]) == {}
    assert cycles_in_detail(life_task(whole), (None,))[0]["cycles"][0]["steps"] == []
