import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.simulation import ExperimentRun
from bsa.core.target import CellChange, change_of, targets_named
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.pybamm.compiled import CompiledExperiment
from bsa.plugins.pybamm.parameter_sets import initial_value
from bsa.plugins.pybamm.solving import solve_reference

GEOMETRY = (
    "Negative particle radius [m]",
    "Negative electrode thickness [m]",
    "Positive electrode porosity",
    "Separator thickness [m]",
)
FACTOR = "Negative electrode exchange-current density [A.m-2] factor"
SOC = "Initial state of charge"


def base() -> dict[str, float]:
    return {**{name: initial_value("Chen2020", name) for name in GEOMETRY}, FACTOR: 1.0, SOC: 0.5}


def largest_difference_mv(a: ExperimentRun, b: ExperimentRun) -> float:
    assert a.trajectory is not None
    assert b.trajectory is not None
    worst = 0.0
    for (_, ours), (_, theirs) in zip(a.trajectory.pieces(), b.trajectory.pieces(), strict=True):
        fractions = np.linspace(0, 1, 40)
        v = [np.interp(p.time[0] + fractions * p.duration, p.time, p.voltage) for p in (ours, theirs)]
        worst = max(worst, 1e3 * float(np.max(np.abs(v[0] - v[1]))))
    return worst


def protocol() -> Experiment:
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    steps = (("Discharge at 1C for 10 minutes", "Rest for 5 minutes", "Charge at 1C for 5 minutes"),)
    return Experiment("short", nothing, steps)


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {GEOMETRY[0]: 1.5, GEOMETRY[1]: 1.3, GEOMETRY[3]: 2.0},
        {GEOMETRY[2]: 0.8, FACTOR: 0.4, SOC: 1.4},
    ],
)
def test_searching_gives_what_a_rebuild_on_the_standard_mesh_gives(
    chen: CompiledExperiment, changes: dict[str, float]
) -> None:
    candidate = {name: value * changes.get(name, 1.0) for name, value in base().items()}
    rebuilt = solve_reference(CellModel("Chen2020"), protocol(), change_of(targets_named(candidate), candidate))
    assert largest_difference_mv(chen.solve(candidate), rebuilt) < 0.1


@pytest.mark.slow
def test_a_solve_does_not_depend_on_the_one_before(chen: CompiledExperiment) -> None:
    first = chen.solve(base())
    chen.solve({**base(), SOC: 0.9, GEOMETRY[1]: 1.1e-4, FACTOR: 3.0})
    assert largest_difference_mv(first, chen.solve(base())) == 0.0


@pytest.mark.slow
def test_steps_carry_kind_cycle_position_and_words(chen: CompiledExperiment) -> None:
    trajectory = chen.solve(base()).trajectory
    assert trajectory is not None
    assert [step.kind for step in trajectory.steps] == [StepKind.CC_DISCHARGE, StepKind.REST, StepKind.CC_CHARGE]
    assert [step.position for step in trajectory.steps] == [0, 1, 2]
    assert trajectory.steps[0].label == "Discharge at 1C for 10 minutes"
    assert trajectory.current[5] == pytest.approx(5.0)


@pytest.mark.slow
def test_a_cell_that_heats_tells_its_temperature() -> None:
    cell = CellModel("Chen2020", "SPM", {"thermal": "lumped"})
    trajectory = CompiledExperiment(cell, protocol(), {}).solve({}).trajectory
    assert trajectory is not None
    assert trajectory.temperature is not None
    assert 298.15 < np.max(trajectory.temperature) < 310.0


@pytest.mark.slow
def test_a_failed_solve_keeps_what_it_reached_and_the_step(chen: CompiledExperiment) -> None:
    run = chen.solve({**base(), SOC: 0.03})
    assert run.failure is not None
    assert run.failure.step == "Discharge at 1C for 10 minutes"
    assert run.failure.cycle == 1
    assert run.trajectory is not None
    assert 0 < run.failure.reached_s < 600


@pytest.mark.slow
def test_an_impossible_state_is_a_failed_trial(chen: CompiledExperiment) -> None:
    run = chen.solve({**base(), SOC: 1.6})
    assert run.failure is not None
    assert "stoichiometries" in run.failure.cause


@pytest.mark.slow
def test_a_measured_current_reproduces_the_protocol_it_came_from(measured: Trajectory) -> None:
    experiment = Experiment("record", measured, None, initial_soc=0.5)
    run = CompiledExperiment(CellModel("Chen2020"), experiment, {}).solve({})
    assert run.failure is None
    assert run.trajectory is not None
    assert np.array_equal(run.trajectory.time, measured.time - measured.time[0])
    assert [step.kind for step in run.trajectory.steps] == [step.kind for step in measured.steps]
    inner = np.ones(len(measured), dtype=bool)
    inner[[step.start for step in measured.steps]] = False  # on which side of a jump they lie is a convention
    assert 1e3 * np.max(np.abs(run.trajectory.voltage - measured.voltage)[inner]) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ORegan2022", "Ecker2015", "Prada2013", "Marquis2019"])
@pytest.mark.parametrize("model", ["SPM", "SPMe", "DFN"])
def test_every_chemistry_and_model_runs(name: str, model: str) -> None:
    experiment = Experiment(
        "x", protocol().target, (("Discharge at 1C for 2 minutes", "Rest for 1 minute"),), initial_soc=0.7
    )
    thickness = "Negative electrode thickness [m]"
    compiled = CompiledExperiment(CellModel(name, model), experiment, targets_named([thickness]))
    run = compiled.solve({thickness: initial_value(name, thickness)})
    assert run.failure is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cell", "steps", "words"),
    [
        (CellModel("Chen2020", "DFM"), ["Rest for 1 minute"], 'did you mean "DFN"'),
        (
            CellModel("Chen2020", options={"SEI": "sometimes"}),
            ["Rest for 1 minute"],
            "PyBaMM refuses the model options",
        ),
        (CellModel("Chen2020"), ["Discharge quickly"], 'PyBaMM cannot read the step "Discharge quickly"'),
        (CellModel("Chen2021"), ["Rest for 1 minute"], 'did you mean "Chen2020"'),
        (CellModel("Chen2020", overrides={"Negative electrode": 1.0}), ["Rest for 1 minute"], "is not a parameter"),
    ],
)
def test_what_cannot_be_built_says_why(cell: CellModel, steps: list[str], words: str) -> None:
    with pytest.raises(BsaError) as caught:
        CompiledExperiment(cell, Experiment("x", protocol().target, (tuple(steps),)), {})
    assert words in str(caught.value)
    assert caught.value.hint


def test_a_record_at_rest_starts_at_its_voltage_whatever_the_candidate() -> None:
    time = np.linspace(0.0, 60.0, 13)
    rest = Trajectory(time, np.zeros(13), np.full(13, 3.9), None, (Step(StepKind.REST, 0, 13),))
    factor = "Negative electrode OCP [V] factor"
    compiled = CompiledExperiment(
        CellModel("Chen2020", "SPM"), Experiment("rest", rest, initial_voltage=3.9), targets_named([factor])
    )
    for value in (1.0, 1.2):
        run = compiled.solve({factor: value})
        assert run.trajectory is not None
        assert run.trajectory.voltage[-1] == pytest.approx(3.9, abs=2e-3)


def test_a_cell_that_runs_empty_keeps_what_it_reached() -> None:
    time = np.linspace(0.0, 7200.0, 721)
    record = Trajectory(time, np.full(721, 5.0), np.full(721, 3.0), None, (Step(StepKind.CC_DISCHARGE, 0, 721),))
    run = solve_reference(CellModel("Chen2020", "SPM"), Experiment("long", record, initial_soc=0.5), CellChange())
    assert run.failure is not None
    assert run.failure.unfinished
    assert run.trajectory is not None
    (step,) = run.trajectory.steps
    assert step.stop == len(run.trajectory) < 721
    assert 1500 < run.failure.reached_s < 2500
    assert run.trajectory.voltage[-1] < 2.5
