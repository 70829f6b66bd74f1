from dataclasses import replace

import numpy as np
import pytest
from bsa.core.comparison.alignment import pair_steps
from bsa.core.comparison.residuals import residuals
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa_toy_cell import CAPACITY, HIDDEN, SERIES, record, space, toy_task
from hypothesis import given
from hypothesis import strategies as st

TASK = toy_task()


def outcome(**changes: float) -> Outcome:
    return Outcome((ExperimentRun(record({**HIDDEN, **changes})),))


def test_a_match_leaves_nothing() -> None:
    found = residuals(TASK, outcome())
    assert found is not None
    assert np.max(np.abs(found)) < 1e-9


@pytest.mark.slow
@given(st.floats(0.8, 1.25), st.floats(0.01, 0.06))
def test_the_layout_depends_on_the_task_alone(factor: float, series: float) -> None:
    found = residuals(TASK, outcome(**{CAPACITY: factor * HIDDEN[CAPACITY], SERIES: series}))
    reference = residuals(TASK, outcome())
    assert found is not None
    assert reference is not None
    assert found.shape == reference.shape
    assert np.all(np.isfinite(found))


@pytest.mark.slow
@given(st.floats(0.9, 1.1))
def test_residuals_are_smooth_although_the_discharge_ends_at_an_event(factor: float) -> None:
    values = [
        residuals(TASK, outcome(**{CAPACITY: (factor + shift) * HIDDEN[CAPACITY]})) for shift in (-1e-3, 0.0, 1e-3)
    ]
    left, middle, right = (value for value in values if value is not None)
    assert np.max(np.abs(right - 2 * middle + left)) < 0.05 * np.max(np.abs(right - left))


def test_a_vanished_step_does_not_shift_the_ones_behind_it() -> None:
    whole = record(HIDDEN)
    without = Trajectory(
        np.concatenate([whole.time[:2], whole.time[202:] - whole.time[202] + 60.0]),
        np.concatenate([whole.current[:2], whole.current[202:]]),
        np.concatenate([whole.voltage[:2], whole.voltage[202:]]),
        None,
        (Step(StepKind.REST, 0, 2), Step(StepKind.REST, 2, 62, position=2)),
    )
    pairs = pair_steps(without, TASK.experiments[0])
    assert [pair.name for pair in pairs] == ["rest 1", "CC discharge", "rest 2"]
    assert pairs[1].simulated is None
    assert pairs[1].duration_s[1] == 0.0
    assert pairs[1].fallback == {"current": whole.current[1], "voltage": whole.voltage[1]}
    assert pairs[2].simulated is not None
    assert residuals(TASK, Outcome((ExperimentRun(without),))) is not None


def steps_of(kinds: list[tuple[StepKind, int]]) -> Trajectory:
    """Steps of so many kinds and cycles, 20 samples each; the voltage rises by 1 mV from sample to sample."""
    current = {StepKind.REST: 0.0, StepKind.CC_CHARGE: -1.0, StepKind.CC_DISCHARGE: 1.0}
    time = np.concatenate([600.0 * place + np.linspace(0.0, 600.0, 20) for place in range(len(kinds))])
    steps = tuple(Step(kind, 20 * place, 20 * place + 20, cycle) for place, (kind, cycle) in enumerate(kinds))
    flows = np.concatenate([np.full(20, current[kind]) for kind, _ in kinds])
    return Trajectory(time, flows, 3.7 + 0.001 * np.arange(len(time)), None, steps)


@pytest.mark.parametrize(("scored_cycle", "stays_at"), [(None, 3.7), (1, 3.7), (2, 3.7 + 0.001 * 59)])
def test_a_vanished_first_step_stays_where_the_simulation_stood_before_it(
    scored_cycle: int | None, stays_at: float
) -> None:
    kinds = (StepKind.CC_CHARGE, StepKind.REST, StepKind.CC_DISCHARGE)
    cycles = [[(kind, cycle) for kind in kinds] for cycle in (1, 2)]
    vanishes_in = scored_cycle or 1
    simulated = steps_of([step for step in cycles[0] + cycles[1] if step != (StepKind.CC_CHARGE, vanishes_in)])
    protocol = (("Charge at 1 A until 4.2 V", "Rest for 10 minutes", "Discharge at 1 A until 3 V"),) * 2
    experiment = Experiment("r", steps_of(cycles[0] + cycles[1]), protocol, scored_cycle)
    first = pair_steps(simulated, experiment)[0]
    assert first.simulated is None
    assert first.fallback is not None
    assert first.fallback["voltage"] == pytest.approx(stays_at)
    task = Task("t", CellModel("x"), space(), (experiment,))
    found = residuals(task, Outcome((ExperimentRun(simulated),)))
    assert found is not None
    # What had not begun has not vanished.
    assert not pair_steps(simulated.slice(0, 40), replace(experiment, scored_cycle=2))[0].reached


def test_under_a_measured_current_the_sum_of_squares_is_the_mean_square_in_mv() -> None:
    target = record(HIDDEN)
    task = Task("t", CellModel("x"), space(), (Experiment("r", target),))
    shifted = Trajectory(target.time, target.current, target.voltage + 0.004, None, target.steps)
    found = residuals(task, Outcome((ExperimentRun(shifted),)))
    assert found is not None
    assert np.mean(found**2) == pytest.approx(16.0)


def relaxing(times: np.ndarray) -> np.ndarray:
    """Volts of a cell that recovers by 0.5 V within seconds, and slowly after that."""
    return 3.3 - 0.5 * np.exp(-times / 15.0) - 0.05 * np.exp(-times / 2000.0)


def rest_of(times: np.ndarray, first_s: float) -> Trajectory:
    """A discharge, and a rest behind it: a sample at the switch, and those of a cycler from ``first_s`` on."""
    kept = times[times >= first_s]
    seen = np.append(kept[0], kept)
    time = 100.0 + np.concatenate([[-100.0, -50.0, 0.0, 0.0], kept])
    current = np.concatenate([[1.0, 1.0, 1.0], np.zeros(len(seen))])
    voltage = np.concatenate([[3.0, 2.9, 2.8], relaxing(seen)])
    steps = (Step(StepKind.CC_DISCHARGE, 0, 3), Step(StepKind.REST, 3, len(time), position=1))
    return Trajectory(time, current, voltage, None, steps, inserted=np.arange(len(time)) == 3)


@pytest.mark.parametrize("protocol", [None, (("Discharge at 1 A for 100 s", "Rest for 1000 s"),)])
def test_a_late_first_sample_says_nothing_of_the_switch(protocol) -> None:
    every_second = np.arange(0.0, 1000.5, 1.0)
    late = rest_of(np.arange(0.0, 1000.5, 50.0), 50.0)
    task = Task("t", CellModel("Chen2020"), space(), (Experiment("r", late, protocol),), signals=toy_task().signals)
    true = rest_of(every_second, 0.0)
    found = residuals(task, Outcome((ExperimentRun(true),)))
    assert found is not None
    assert np.max(np.abs(found)) < 1e-6
    # Were the sample at the switch believed, half a volt would be missing there.
    believed = Experiment("r", replace(late, inserted=None), protocol)
    wrong = residuals(replace(task, experiments=(believed,)), Outcome((ExperimentRun(true),)))
    assert wrong is not None
    assert np.max(np.abs(wrong)) > 100.0


def fast_charge(stages: list[int]) -> Trajectory:
    """Stages of a fast charge, by their place in the protocol: each of 20 samples."""
    parts = [(15.0, 60.0, 3.9, 4.0), (10.0, 600.0, 3.95, 4.1), (5.0, 900.0, 4.05, 4.2)]
    time, current, voltage, clock = [], [], [], 0.0
    for place in stages:
        amperes, seconds, first_v, last_v = parts[place]
        time.append(clock + np.linspace(0.0, seconds, 20))
        current.append(np.full(20, -amperes))
        voltage.append(np.linspace(first_v, last_v, 20))
        clock += seconds
    steps = tuple(Step(StepKind.CC_CHARGE, 20 * n, 20 * n + 20, 1, "", position) for n, position in enumerate(stages))
    return Trajectory(np.concatenate(time), np.concatenate(current), np.concatenate(voltage), steps=steps)


def test_a_stage_that_vanishes_does_not_shift_those_of_its_kind_behind_it() -> None:
    experiment = Experiment("fast", fast_charge([0, 1, 2]), protocol=(("a", "b", "c"),))
    pairs = pair_steps(fast_charge([1, 2]), experiment)
    assert [None if pair.simulated is None else pair.simulated.duration for pair in pairs] == [None, 600.0, 900.0]


def test_steps_are_matched_by_their_kind_where_the_record_has_more_of_them() -> None:
    def cell(kinds: list[StepKind]) -> Trajectory:
        steps = tuple(Step(kind, 20 * n, 20 * n + 20, 1, "", n) for n, kind in enumerate(kinds))
        return Trajectory(np.arange(20.0 * len(kinds)), *(np.full(20 * len(kinds), v) for v in (1.0, 3.7)), steps=steps)

    record_has = cell([StepKind.REST, StepKind.CC_DISCHARGE, StepKind.REST])
    pairs = pair_steps(
        cell([StepKind.CC_DISCHARGE, StepKind.REST]), Experiment("r", record_has, protocol=(("a", "b"),))
    )
    assert [pair.simulated is not None for pair in pairs] == [True, True, False]
