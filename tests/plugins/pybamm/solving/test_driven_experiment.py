from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bsa.core.target import CellChange, target_named
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.pybamm.cells.parameter_sets import pybamm
from bsa.plugins.pybamm.modelling import drive
from bsa.plugins.pybamm.modelling.resolution import Resolution
from bsa.plugins.pybamm.solving.driven_cell import DrivenCell, Pause
from bsa.plugins.pybamm.solving.driven_experiment import DrivenExperiment, _in_words
from bsa.plugins.pybamm.solving.experiment_kinds import compiled, solve_reference

SPM = CellModel("Chen2020", "SPM")
LITHIUM = "Cyclable lithium factor"


def discharge(current_a: float = 5.0, hours: float = 2.0) -> Trajectory:
    """A discharge with a rest behind it."""
    time = np.linspace(0.0, 3600.0 * hours, 721)
    time = np.concatenate([time, time[-1] + np.arange(1.0, 61.0) * 10.0])
    current = np.where(np.arange(781) < 721, current_a, 0.0)
    steps = (Step(StepKind.CC_DISCHARGE, 0, 721), Step(StepKind.REST, 721, 781))
    return Trajectory(time, current, np.full(781, 3.0), None, steps)


@pytest.mark.slow
def test_a_measured_current_reproduces_the_protocol_it_came_from(measured: Trajectory) -> None:
    experiment = Experiment("record", measured, None, initial_soc=0.5)
    run = compiled(CellModel("Chen2020"), experiment, {}).solve({})
    assert isinstance(compiled(CellModel("Chen2020"), experiment, {}), DrivenExperiment)
    assert run.failure is None
    assert run.limits == ()
    assert run.trajectory is not None
    assert np.array_equal(run.trajectory.time, measured.time - measured.time[0])
    assert run.trajectory.steps == measured.steps
    inner = np.ones(len(measured), dtype=bool)
    inner[[step.start for step in measured.steps]] = False  # on which side of a jump they lie is a convention
    assert 1e3 * np.max(np.abs(run.trajectory.voltage - measured.voltage)[inner]) < 1.0
    assert np.max(np.abs(run.trajectory.current - measured.current)[inner]) < 1e-6


def test_a_record_at_rest_starts_at_its_voltage_whatever_the_candidate() -> None:
    time = np.linspace(0.0, 60.0, 13)
    rest = Trajectory(time, np.zeros(13), np.full(13, 3.9), None, (Step(StepKind.REST, 0, 13),))
    factor = "Negative electrode OCP [V] factor"
    driven = compiled(SPM, Experiment("rest", rest, initial_voltage=3.9), {factor: target_named(factor)})
    for value in (1.0, 1.2):
        run = driven.solve({factor: value})
        assert run.trajectory is not None
        assert run.trajectory.voltage[-1] == pytest.approx(3.9, abs=2e-3)


def test_a_cell_that_starts_warm_cools_to_what_is_around_it() -> None:
    time = np.linspace(0.0, 7200.0, 121)
    rest = Trajectory(time, np.zeros(121), np.full(121, 3.9), None, (Step(StepKind.REST, 0, 121),))
    warm = Experiment("rest", rest, temperature_k=298.15, initial_soc=0.5, initial_temperature_k=308.15)
    run = compiled(CellModel("Chen2020", "SPM", {"thermal": "lumped"}), warm, {}).solve({})
    assert run.trajectory is not None
    assert run.trajectory.temperature is not None
    assert run.trajectory.temperature[[0, -1]] == pytest.approx([308.15, 298.15], abs=0.1)


@pytest.mark.slow
def test_an_offset_is_added_wherever_a_current_passes() -> None:
    record = discharge(1.0, hours=0.5)
    name = "Current offset: r [A]"
    changed = record.changed(current=np.where(record.current == 0.0, 0.0, record.current + 0.25))
    wanted = compiled(SPM, Experiment("r", changed, initial_soc=0.5), {}).solve({}).trajectory
    driven = compiled(SPM, Experiment("r", record, initial_soc=0.5), {name: target_named(name)})
    found, unchanged = (driven.solve({name: offset}).trajectory for offset in (0.25, 0.0))
    final = solve_reference(SPM, Experiment("r", record, initial_soc=0.5), CellChange(current_offset={"r": 0.25}))
    assert wanted is not None
    assert found is not None
    assert unchanged is not None
    assert final.trajectory is not None
    assert np.max(np.abs(found.voltage - wanted.voltage)) < 1e-4
    assert np.max(np.abs(final.trajectory.voltage - wanted.voltage)) < 1e-3
    assert np.max(np.abs(unchanged.voltage - wanted.voltage)) > 5e-3
    # The record's own current is what is compared and shown.
    assert np.array_equal(found.current, unchanged.current)
    other = compiled(SPM, Experiment("another", record, initial_soc=0.5), {name: target_named(name)})
    assert np.array_equal(other.solve({name: 0.25}).trajectory.voltage, unchanged.voltage)


@pytest.mark.slow
def test_a_cell_that_runs_empty_is_a_finite_error_and_says_so() -> None:
    record = discharge()
    driven = compiled(SPM, Experiment("long", record, initial_soc=0.5), {LITHIUM: target_named(LITHIUM)})
    reference = solve_reference(SPM, Experiment("long", record, initial_soc=0.5), CellChange())
    for run in (driven.solve({LITHIUM: 1.0}), reference):
        assert run.failure is None
        (limit,) = run.limits
        assert limit.startswith("the simulated cell was empty at 1,")
        assert " s of 7,800 s, after 2." in limit
        assert limit.endswith(" A.h; the record draws 10 A.h, 3.8 times as much")
        ((begin, end),) = run.at_limit
        assert f"at {begin:,.0f} s" in limit
        assert end == 7200.0
        assert run.trajectory is not None
        assert run.trajectory.steps == record.steps
        assert np.all(run.trajectory.voltage[400:721] == 2.0)  # half a volt below the cut-off
        assert np.all(run.trajectory.current[400:721] == 0.0)
        assert 2.0 < run.trajectory.voltage[-1] < 3.5
    lasted = [np.sum(driven.solve({LITHIUM: factor}).trajectory.voltage > 2.0) for factor in (0.95, 1.0, 1.05)]
    assert len(set(lasted)) == 3


class GivesUpAtTheLimit:
    """An integrator that finds no consistent state to go on from, as tight tolerances do at empty particles."""

    def __init__(self, own: Any) -> None:
        self._own = own

    def solve(self, *arguments: Any, **how: Any) -> Any:
        return self._own.solve(*arguments, **how)

    def step(self, *arguments: Any, **how: Any) -> Any:
        raise pybamm.SolverError("IDAGetDky: IDA_BAD_K")


def test_an_empty_cell_goes_on_where_its_own_tolerances_are_too_tight() -> None:
    driven = compiled(SPM, Experiment("long", discharge(), initial_soc=0.5), {})
    usual = driven.solve({}).trajectory
    cell = driven._driven  # type: ignore[union-attr]
    cell._solver = GivesUpAtTheLimit(cell._solver)
    run = driven.solve({})
    assert len(run.limits) == 1
    assert " more" not in run.limits[0]
    assert run.trajectory is not None
    assert usual is not None
    assert 2.0 < run.trajectory.voltage[-1] < 3.5
    assert np.max(np.abs(run.trajectory.voltage - usual.voltage)[722:]) < 1e-3


def test_a_cell_that_runs_full_says_so() -> None:
    record = discharge(-5.0)
    run = compiled(SPM, Experiment("charge", record, initial_soc=0.5), {}).solve({})
    assert run.failure is None
    assert run.limits[0].startswith("the simulated cell was full at ")
    assert "; the record charges 10 A.h, " in run.limits[0]
    assert run.trajectory is not None
    assert run.trajectory.voltage[600] == pytest.approx(4.7)


def test_a_candidate_that_cannot_start_is_a_failure_with_its_reason() -> None:
    run = compiled(SPM, Experiment("long", discharge(), initial_soc=0.5), {LITHIUM: target_named(LITHIUM)}).solve(
        {LITHIUM: 4.0}
    )
    assert run.trajectory is None
    assert run.failure is not None
    assert run.failure.cause


@pytest.mark.slow
def test_what_the_integrator_reached_before_it_gave_up_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    driven = DrivenExperiment(SPM, Experiment("long", discharge(1.0, 1.0), initial_soc=0.9), {})
    own = driven._driven
    whole = own._solver.solve

    def stopping(model: object, t_eval: np.ndarray, t_interp: np.ndarray, inputs: dict[str, float]) -> object:
        short = t_interp[t_interp <= 1000.0]
        found = whole(model, t_eval=np.append(t_eval[t_eval < 1000.0], short[-1]), t_interp=short, inputs=inputs)
        found.termination = "failure"
        return found

    monkeypatch.setattr(own._solver, "solve", stopping)
    run = driven.solve({})
    assert run.failure is not None
    assert run.failure.unfinished
    assert run.failure.reached_s == pytest.approx(1000.0, abs=6.0)
    assert run.trajectory is not None
    assert run.trajectory.steps == (Step(StepKind.CC_DISCHARGE, 0, len(run.trajectory)),)


def test_the_current_as_a_table_is_what_pybamm_interpolates() -> None:
    time, current = np.array([0.0, 1.0, 1.5, 4.0]), np.array([0.0, 2.0, -1.0, 3.0])
    known = drive.CurrentFunction(time, current, time[[0, -1]], None)
    own = drive.interpolant(known)
    assert type(own.create_copy()) is type(own)
    for at in (0.0, 0.3, 1.0, 1.2, 3.9):
        assert own.evaluate(t=at).item() == pytest.approx(np.interp(at, time, current))
    import casadi

    t = casadi.MX.sym("t")
    function = casadi.Function("current", [t], [own.to_casadi(t)])
    assert [float(function(at)) for at in (0.3, 1.2, 3.9)] == pytest.approx(np.interp([0.3, 1.2, 3.9], time, current))
    assert isinstance(own, pybamm.Interpolant)


def test_records_of_many_knots_need_no_knots_of_one_time() -> None:
    record = discharge()
    doubled = replace(record.steps[0], stop=720), replace(record.steps[0], start=720, stop=721), record.steps[1]
    function = drive.current_function(Trajectory(record.time, steps=doubled, signals=record.signals))
    assert np.all(np.diff(function.time) > 0)


@pytest.mark.slow
def test_a_drive_cycle_is_followed_from_sample_to_sample() -> None:
    rng = np.random.default_rng(0)
    time = 0.1 * np.arange(151)
    current = np.repeat(rng.uniform(-5.0, 15.0, 31), 5)[:151] + rng.normal(0.0, 0.002, 151)
    record = Trajectory(time, current, np.full(151, 3.7), None, (Step(StepKind.DRIVE, 0, 151),))
    experiment = Experiment("drive", record, initial_soc=0.7)
    ours = compiled(CellModel("Chen2020", "SPMe"), experiment, {}).solve({})
    fine = Resolution(rtol=1e-8)
    theirs = solve_reference(CellModel("Chen2020", "SPMe"), experiment, CellChange(), fine)
    assert ours.failure is None
    assert ours.trajectory is not None
    assert theirs.trajectory is not None
    assert 1e3 * np.max(np.abs(ours.trajectory.voltage - theirs.trajectory.voltage)) < 0.2
    # What is ohmic follows each sample at once.
    jumps = np.abs(np.diff(current)) > 1.0
    change = np.diff(ours.trajectory.voltage)[jumps] / np.diff(current)[jumps]
    assert np.all(change < -0.01)


def test_the_words_of_a_limit_count_further_times_and_name_a_clear_lack_of_charge_alone() -> None:
    record = discharge(5.0, 1.0)
    late, again = Pause(3500.0, 3600.0, 3600.0, True), Pause(3900.0, 4000.0, 4000.0, True)
    at_last = replace(late, start=4100.0, end=4200.0, step_end=4200.0)
    assert _in_words((at_last,), record) == ("the simulated cell was empty at 4,100 s of 4,200 s",)
    # A rest behind the discharge does not make the limit look early.
    (words,) = _in_words((late,), record)
    assert words == "the simulated cell was empty at 3,500 s of 4,200 s, 100 s before the step ended"
    assert _in_words((late, again), record)[0].endswith(" ended, and 1 time more")
    assert _in_words((late, again, at_last), record)[0].endswith(" ended, and 2 times more")
    # Of one step several are one time.
    assert _in_words((replace(late, end=3520.0), replace(late, start=3540.0)), record) == (words,)
    goes_on = replace(late, start=3550.0, end=np.inf)
    assert _in_words((late, goes_on), record) == _in_words((late,), record)
    (early,) = _in_words((Pause(1800.0, 3600.0, 3600.0, True),), record)
    assert early.endswith("at 1,800 s of 4,200 s, after 2.5 A.h; the record draws 5.01 A.h, 2 times as much")


@pytest.mark.slow
def test_the_first_seconds_after_a_changed_current_are_resolved_with_lengths_that_are_searched_too() -> None:
    # 100 s of rest and 20 s of 2C, sampled every 0.5 s.
    time = np.arange(0.0, 120.5, 0.5)
    current = np.where(time > 100.0, 10.0, 0.0)
    steps = (Step(StepKind.REST, 0, 201), Step(StepKind.CC_DISCHARGE, 201, 241))
    pulse = Experiment("pulse", Trajectory(time, current, np.full(241, 3.8), None, steps), initial_soc=0.5)
    slow = CellModel("Chen2020", "SPM", overrides={"Positive particle diffusivity [m2.s-1]": 1e-15})
    resolved = DrivenCell(
        slow, (), pulse.target, {}, resolution=Resolution(1e-6, radial_points=200, standard_mesh=True)
    ).solve({}, time, current, 0.5)
    assert resolved is not None
    radius, value = "Positive particle radius [m]", 5.22e-6
    runs = [compiled(slow, pulse, {radius: target_named(radius)}).solve({radius: value})]
    runs.append(solve_reference(slow, pulse, CellChange(values={radius: value})))
    for run in runs:
        assert run.trajectory is not None
        # On PyBaMM's 20 uniform points it is 39 mV.
        assert np.max(np.abs(run.trajectory.voltage - resolved.voltage)[202:]) < 2.5e-3
