import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.simulation import ExperimentRun
from bsa.core.target import CellChange, InitialVoltage, change_of, target_named
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import StepKind, Trajectory
from bsa.plugins.effects.catalogue import EFFECTS
from bsa.plugins.pybamm.cells.parameter_sets import initial_value, load
from bsa.plugins.pybamm.modelling.compiled_cell import added_potentials
from bsa.plugins.pybamm.solving.compiled import CompiledExperiment
from bsa.plugins.pybamm.solving.experiment_kinds import solve_reference

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
    rebuilt = solve_reference(
        CellModel("Chen2020"), protocol(), change_of({key: target_named(key) for key in candidate}, candidate)
    )
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
def test_a_protocol_whose_every_step_is_skipped_is_a_failed_trial() -> None:
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    experiment = Experiment("over", nothing, (("Discharge at 1C until 4 V",),), initial_soc=0.5)
    run = CompiledExperiment(CellModel("Chen2020", "SPM"), experiment, {}).solve({})
    assert run.trajectory is None
    assert run.failure is not None
    assert "had reached its end" in run.failure.cause


@pytest.mark.slow
def test_a_cycle_whose_only_step_is_skipped_leaves_the_others_their_places() -> None:
    nothing, skipped = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1)), ("Charge at 1C until 4.0 V",)
    steps = (skipped, ("Rest for 1 minute", "Discharge at 1C for 1 minute"), skipped, ("Rest for 2 minutes",))
    experiment = Experiment("x", nothing, steps, initial_soc=1.0)
    run = CompiledExperiment(CellModel("Chen2020", "SPM"), experiment, {}).solve({})
    assert run.failure is None
    assert run.trajectory is not None
    places = [(step.kind, step.cycle, step.position) for step in run.trajectory.steps]
    assert places == [(StepKind.REST, 2, 0), (StepKind.CC_DISCHARGE, 2, 1), (StepKind.REST, 4, 0)]


@pytest.mark.slow
@pytest.mark.parametrize("skipped", [1, 2])
def test_a_step_that_dies_behind_skipped_ones_says_why(skipped: int) -> None:
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    steps = (("Charge at 1C until 4.0 V",) * skipped + ("Discharge at 1000C for 10 minutes",),)
    experiment = Experiment("x", nothing, steps, initial_soc=1.0)
    run = CompiledExperiment(CellModel("Chen2020", "DFN"), experiment, {}).solve({})
    assert run.trajectory is None
    assert run.failure is not None
    assert "IDA" in run.failure.cause
    assert run.failure.step.startswith("Discharge at 1000C")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ORegan2022", "Ecker2015", "Prada2013", "Marquis2019"])
@pytest.mark.parametrize("model", ["SPM", "SPMe", "DFN"])
def test_every_chemistry_and_model_runs(name: str, model: str) -> None:
    experiment = Experiment(
        "x", protocol().target, (("Discharge at 1C for 2 minutes", "Rest for 1 minute"),), initial_soc=0.7
    )
    thickness = "Negative electrode thickness [m]"
    compiled = CompiledExperiment(CellModel(name, model), experiment, {thickness: target_named(thickness)})
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


@pytest.mark.slow
def test_steps_end_and_are_held_at_the_voltage_that_an_effect_adds_to() -> None:
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    steps = ("Discharge at 2C until 3.3 V", "Charge at 2C until 4.1 V", "Hold at 4.1 V until C/2")
    cell = CellModel("Chen2020", "SPM", effects=("ocp-hysteresis",))
    effect = CellChange(effects={"ocp-hysteresis: half_gap [V]": 0.05, "ocp-hysteresis: decay": 20.0})
    run = solve_reference(cell, Experiment("cycle", nothing, (steps,), initial_soc=0.6), effect)
    assert run.failure is None
    assert run.trajectory is not None
    ends = [float(piece.voltage[-1]) for _, piece in run.trajectory.pieces()]
    assert ends == pytest.approx([3.3, 4.1, 4.1], abs=1e-4)


@pytest.mark.parametrize("electrode", ["negative", "positive"])
def test_a_start_by_voltage_is_where_the_cell_with_its_effects_shows_it(electrode: str) -> None:
    cell = CellModel("Chen2020", "SPM", effects=(f"ocp-shape.{electrode}-electrode",))
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    experiment = Experiment("rest", nothing, (("Rest for 1 minute",),), initial_voltage=3.8)
    shape = CellChange(effects={"ocp-shape: height [V]": 0.05, "ocp-shape: stoichiometry": 0.5})
    run = solve_reference(cell, experiment, shape)
    assert run.trajectory is not None
    assert run.trajectory.voltage[0] == pytest.approx(3.8, abs=1e-4)


def test_a_cell_starts_where_it_has_the_rest_voltage_as_a_candidate_corrects_it() -> None:
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    experiment = Experiment("rest", nothing, (("Rest for 1 minute",),), initial_voltage=3.8)
    name = "Initial voltage correction at 3.80 V [V]"
    compiled = CompiledExperiment(CellModel("Chen2020", "SPM"), experiment, {name: InitialVoltage(3.8)})
    baked = solve_reference(CellModel("Chen2020", "SPM"), experiment, CellChange(initial_voltage={3.8: 0.02}))
    for run in (compiled.solve({name: 0.02}), baked):
        assert run.trajectory is not None
        assert run.trajectory.voltage[0] == pytest.approx(3.82, abs=1e-4)


@pytest.mark.parametrize("strength", ["null", "probe"])
def test_effects_that_leave_the_potentials_add_nothing_to_them(strength: str) -> None:
    candidate = {effect.full_name(p): getattr(p, strength) for effect in EFFECTS for p in effect.parameters}
    for effect in EFFECTS:
        if effect.name != "ocp-shape" and effect.physics is not None:
            assert added_potentials(load("Chen2020"), (effect,), candidate) == {}


def test_an_effect_on_the_measured_current_is_refused_where_steps_set_their_own() -> None:
    cell = CellModel("Chen2020", "SPM", effects=("self-discharge",))
    with pytest.raises(BsaError, match="acts on the measured current"):
        CompiledExperiment(cell, protocol(), {})
