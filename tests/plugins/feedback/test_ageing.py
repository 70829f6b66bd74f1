"""Feedback on long records, of a size that does not depend on their length."""

import json
from dataclasses import replace

import numpy as np
import pytest
from bsa.core.ageing.choice import SHOWN, kept_cycles
from bsa.core.ageing.cycle_table import CycleTable
from bsa.core.cell import CELL
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.feedback.ageing import cycles_in_detail, fade_features, measured_life, told_cycles
from bsa.plugins.feedback.features import features
from bsa_toy_cell import space

STEPS = ("Charge at 1 A until 4.2 V", "Discharge at 1 A until 3 V")


def life(count: int, lost: float, bend: float = 1.0) -> Trajectory:
    """``lost`` A.h of 1 A.h go over the whole life, late where ``bend`` is large; 21 samples a step."""
    kept = kept_cycles(count)
    share = (np.arange(count) / (count - 1)) ** bend
    table = CycleTable(np.arange(1.0, count + 1), 1.0 - lost * share, 0.02 * (1.0 + lost * share), np.full(count, 4.2))
    rows = np.linspace(0.0, 1.0, 21)
    time, current, voltage, steps = [], [], [], []
    for cycle in kept:
        for position, (kind, sign) in enumerate(((StepKind.CC_CHARGE, -1.0), (StepKind.CC_DISCHARGE, 1.0))):
            start = time[-1][-1] if time else 0.0
            steps.append(Step(kind, 21 * len(time), 21 * (len(time) + 1), cycle, STEPS[position], position))
            time.append(start + 3600.0 * table.capacity_ah[cycle - 1] * rows)
            current.append(np.full(21, sign))
            voltage.append((3.2 + rows if sign < 0 else 4.2 - rows) - 0.02 * lost * sign)
    parts = (np.concatenate(part) for part in (time, current, voltage))
    return Trajectory(*parts, None, tuple(steps), cycle_table=table)


def task(target: Trajectory) -> Task:
    count = len(target.cycle_table.cycle) if target.cycle_table is not None else 0
    experiment = Experiment("life", target, (STEPS,) * count, detailed_cycles=target.cycles)
    return Task("ageing", CellModel("x"), space(), (experiment,), domain=CELL)


def told(count: int, lost: float) -> dict[str, float]:
    return features(task(life(count, 0.2)), Outcome((ExperimentRun(life(count, lost)),)))


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
    assert told_cycles(task(target).experiments[0])[1] in range(80, 170)
    assert "knee_at_cycle" in measured_life(task(target).experiments[0])


@pytest.mark.parametrize("count", [40, 2000])
def test_no_more_is_told_of_a_longer_life(count: int) -> None:
    made = task(life(count, 0.2, bend=4.0))
    detail = cycles_in_detail(made, (life(count, 0.1),), asked=tuple(range(1, count)))
    assert len(detail[0]["cycles"]) <= SHOWN
    assert len(json.dumps(detail)) < 4000
    assert len(json.dumps(measured_life(made.experiments[0]))) < 1000
    assert len(told(count, 0.1)) <= 40


def test_the_cycles_in_detail_say_why_they_are_shown() -> None:
    [detail] = cycles_in_detail(task(life(200, 0.2)), (life(200, 0.1),), asked=(40,))
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
    found = fade_features(ExperimentRun(part), task(life(200, 0.2)).experiments[0])
    assert "capacity_mismatch_cycle_100_pct" in found or "capacity_mismatch_cycle_101_pct" in found
    assert "capacity_mismatch_cycle_200_pct" not in found
    assert "fade_mismatch_pct" not in found
    assert fade_features(ExperimentRun(None), task(whole).experiments[0]) == {}
    assert cycles_in_detail(task(whole), (None,))[0]["cycles"][0]["steps"] == []
