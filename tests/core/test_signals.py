"""Records of any signals: how they are kept, compared, scored and told."""

import json
from dataclasses import replace

import numpy as np
import pytest
from bsa.core.cell import CELL, CURRENT, VOLTAGE
from bsa.core.comparison.paper_metrics import require_paper
from bsa.core.comparison.record_errors import errors_by_record
from bsa.core.comparison.residuals import residuals, rows_of
from bsa.core.domain import Domain
from bsa.core.encoding import decode_task, decode_trajectory, encode_task, encode_trajectory
from bsa.core.errors import BsaError
from bsa.core.metrics import decode_metrics, errors_of, evaluate, objective_of, told_of
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.signals import Signal, compared
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa_toy_cell import toy_task
from hypothesis import given
from hypothesis import strategies as st

FLOW = Signal("flow", "l/s", role="driven")
LEVEL = Signal("level", "m", tolerance=0.01, shown_unit="cm", shown_scale=100.0)
OUTFLOW = Signal("outflow", "l/s", tolerance=0.5, label="Outflow at the weir")
TANK = Domain("water tank", signals=(FLOW, LEVEL, OUTFLOW), rules=({"parameter": "Area", "raises": [], "lowers": []},))


def record(level_m: float = 0.0, outflow: float = 0.0) -> Trajectory:
    """Two steps of a tank: filled for 100 s, drained for 300 s."""
    time = np.linspace(0.0, 400.0, 401)
    signals = {
        "flow": np.where(time <= 100.0, 2.0, 0.0),
        "level": 1.0 + 0.01 * np.minimum(time, 100.0) + level_m,
        "outflow": np.full(401, 3.0) + outflow,
    }
    return Trajectory(time, steps=(Step("filling", 0, 101), Step("draining", 101, 401, position=1)), signals=signals)


def tank(**changes: object) -> Task:
    space = ParameterSpace((Parameter("Area [m2]", 1.0, 0.5, 2.0),))
    return replace(
        Task("tank", CellModel("", "tank"), space, (Experiment("a", record()),), domain=TANK, simulator="tank"),
        **changes,
    )


def test_a_pulse_of_what_is_no_cell_counts_as_long_as_the_rest_behind_it() -> None:
    steps = (Step("pulse", 0, 101), Step("rest", 101, 401, position=1))
    pulsed = replace(record(), steps=steps)
    found = residuals(
        tank(experiments=(Experiment("a", pulsed),)), Outcome((ExperimentRun(replace(record(0.02), steps=steps)),))
    )
    assert found is not None
    pulse, rest = np.split(found, 2)
    assert pulse @ pulse == pytest.approx(rest @ rest)


def outcome(level_m: float = 0.0, outflow: float = 0.0) -> Outcome:
    return Outcome((ExperimentRun(record(level_m, outflow)),))


def test_a_trajectory_carries_any_signals_through_slices_and_files() -> None:
    whole = record()
    part = replace(whole, inserted=np.arange(len(whole)) == 101).slice(101, 401).thinned(10)
    assert set(part.signals) == {"flow", "level", "outflow"}
    assert [step.kind for step in part.steps] == ["draining"]
    again = decode_trajectory(json.loads(json.dumps(encode_trajectory(part))))
    assert again.steps == part.steps
    assert list(np.flatnonzero(again.inserted)) == [0]
    for name, values in part.signals.items():
        np.testing.assert_array_equal(again.values(name), values)


def test_a_signal_that_a_record_lacks_is_named() -> None:
    with pytest.raises(BsaError, match='no signal "voltage"'):
        _ = record().voltage
    with pytest.raises(BsaError, match=r"lacks the signals \['outflow'\]"):
        tank(
            experiments=(
                Experiment("a", Trajectory(np.arange(3.0), signals={"flow": np.ones(3), "level": np.ones(3)})),
            )
        )


def test_an_optional_signal_is_compared_where_a_record_has_it() -> None:
    optional = replace(OUTFLOW, optional=True)
    bare = record()
    bare = Trajectory(bare.time, steps=bare.steps, signals={name: bare.values(name) for name in ("flow", "level")})
    task = tank(signals=(FLOW, LEVEL, optional), experiments=(Experiment("a", record()), Experiment("b", bare)))
    off = Outcome(2 * outcome(0.0, 1.0).runs)
    rows, found = rows_of(task), residuals(task, off)
    assert found is not None
    assert len(found) == len(rows.record)
    assert set(rows.signal[rows.record == 1]) == {"level"}
    assert np.count_nonzero(found) == np.count_nonzero(rows.signal == "outflow") > 0
    metrics = evaluate(task, off)
    assert metrics is not None
    assert metrics.value("outflow_rmse_l_s") == pytest.approx(1.0)
    assert [set(errors.signals) for errors in errors_by_record(task, off)] == [{"level", "outflow"}, {"level"}]


def test_a_cyclers_kinds_are_told_by_identity_wherever_they_come_from() -> None:
    assert Step("CV hold", 0, 1).kind is StepKind.CV_HOLD
    assert Step("free decay", 0, 1).kind == "free decay"


def test_the_current_answers_in_a_voltage_hold_of_a_protocol_alone() -> None:
    assert compared(CELL.signals, StepKind.CV_HOLD, by_protocol=True) == (CURRENT,)
    assert compared(CELL.signals, StepKind.CV_HOLD, by_protocol=False) == (VOLTAGE,)
    assert compared(CELL.signals, StepKind.REST, by_protocol=True) == (VOLTAGE,)


def test_a_task_of_a_cell_is_encoded_as_it_always_was() -> None:
    assert set(encode_task(toy_task())) == {"name", "cell", "space", "experiments", "notes"}
    again = decode_task(json.loads(json.dumps(encode_task(toy_task()))))
    assert again.domain is CELL
    assert again.signals == CELL.signals


def test_a_task_of_another_domain_comes_back_whole() -> None:
    task = replace(tank(signals=(FLOW, LEVEL)), weight="robust")
    again = decode_task(json.loads(json.dumps(encode_task(task))))
    assert (again.domain, again.signals, again.simulator) == (TANK, (FLOW, LEVEL), "tank")
    assert again.weight == "robust"


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_the_misfit_counts_every_observed_signal_in_its_tolerance(levels: float, outflows: float) -> None:
    shifted = outcome(levels * LEVEL.tolerance, outflows * OUTFLOW.tolerance)
    metrics = evaluate(tank(), shifted)
    assert metrics is not None
    assert metrics.objective == pytest.approx(np.sqrt((levels**2 + outflows**2) / 2), abs=1e-9)
    assert metrics.value("level_rmse_cm") == pytest.approx(abs(levels), abs=1e-9)
    assert metrics.value("outflow_rmse_l_s") == pytest.approx(abs(0.5 * outflows), abs=1e-9)
    assert decode_metrics(json.loads(json.dumps(metrics.as_json()))) == metrics


def test_residuals_of_a_failed_simulation_are_none_and_so_is_its_score() -> None:
    failed = Outcome((ExperimentRun(record().slice(0, 101), SimulationFailure("dry")),))
    assert residuals(tank(), failed) is None
    assert evaluate(tank(), failed) is None


def test_a_protocol_adds_the_steps_durations() -> None:
    task = tank(experiments=(Experiment("a", record(), (("fill for 100 s", "drain for 300 s"),)),))
    same, driven = residuals(task, outcome()), residuals(tank(), outcome())
    assert same is not None
    assert driven is not None
    np.testing.assert_allclose(same, 0.0, atol=1e-12)
    assert len(same) == 2 * (2 * 16 + 1)
    assert len(driven) == 2 * 2 * 40


def test_the_errors_are_named_after_the_signals() -> None:
    assert objective_of(tank()).of_unit == "tolerances RMS misfit"
    assert [quantity.label for quantity in errors_of(tank())] == [
        "RMS misfit",
        "Level RMSE",
        "Outflow at the weir RMSE",
    ]
    assert [quantity.told for quantity in told_of(tank())] == [
        "rms_misfit_tolerances",
        "level_rmse_cm",
        "outflow_rmse_l_s",
    ]
    assert objective_of(toy_task()).of_unit == "% total MAPE"


def test_what_needs_the_papers_errors_refuses_other_tasks() -> None:
    require_paper(toy_task(), "qnehvi")
    with pytest.raises(BsaError, match='task "tank" does not have'):
        require_paper(tank(), "qnehvi")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"name": "Level"}, 'named "Level"'),
        ({"name": "time"}, 'named "time"'),
        ({"tolerance": 0.0}, "tolerance > 0"),
        ({"tolerance": float("nan")}, "tolerance > 0"),
        ({"role": "watched"}, 'role is "watched"'),
    ],
)
def test_a_wrong_signal_is_refused(changes: dict[str, object], said: str) -> None:
    with pytest.raises(BsaError, match=said):
        replace(LEVEL, **changes)


def test_a_task_that_observes_nothing_is_refused() -> None:
    with pytest.raises(BsaError, match="observes no signal"):
        tank(signals=(FLOW,))
    with pytest.raises(BsaError, match="observes no signal"):
        tank(domain=Domain("nothing"), signals=())


def test_values_are_printed_to_what_the_tolerance_resolves() -> None:
    assert LEVEL.printed(1.23456) == "1.23 m"
    assert VOLTAGE.printed(3.70021) == "3.700 V"
    assert CURRENT.printed(1.23456) == "1.23 A"
