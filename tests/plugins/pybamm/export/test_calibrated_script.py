"""The exported script: literal-safe, importable, and the same curve as the final score."""

import ast
import re
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from bsa.core.comparison.spectrum_record import spectrum_record
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.spectrum import ImpedanceSpectrum
from bsa.core.target import CYCLABLE_LITHIUM, CellChange, change_of, target_named
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.api.scripts import namespace_of
from bsa.plugins.effects.ageing import EFFECTS
from bsa.plugins.pybamm.augmentation import effects_in
from bsa.plugins.pybamm.cells.parameter_files import parsed
from bsa.plugins.pybamm.export.calibrated_script import literal, parameter_values_json, script
from bsa.plugins.pybamm.solving import compiled, driven_cell
from bsa.plugins.pybamm.solving.experiment_kinds import solve_reference

NOTHING = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
RADIUS = "Positive particle radius [m]"
EXCHANGE = "Positive electrode exchange-current density [A.m-2] factor"
SOC = "Initial state of charge"


def task_of(cell, experiment, *names):
    space = ParameterSpace(tuple(Parameter(name, 0.5, 1e-9, 1e9, target=target_named(name)) for name in names))
    return Task("export", cell, space, (experiment,))


def drive_record():
    """A rest, a discharge, a decaying charge, a noisy drive cycle: every way in which a current is embedded."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 2401.0, 10.0)
    current = np.zeros(len(time))
    current[30:90] = 2.0
    current[90:150] = -2.0 * np.exp(-np.arange(60) / 25)
    current[180:] = rng.uniform(-1.0, 3.0, len(time) - 180)
    kinds = (StepKind.REST, StepKind.CC_DISCHARGE, StepKind.CV_HOLD, StepKind.REST, StepKind.DRIVE)
    edges = (0, 30, 90, 150, 180, len(time))
    steps = tuple(Step(kind, *edge) for kind, edge in zip(kinds, pairwise(edges), strict=True))
    return Trajectory(time, current, np.full(len(time), 3.7), None, steps)


DRIVEN = Experiment("drive", drive_record(), initial_soc=0.6)

HOSTILE = 'x"""\nimport os; os.abort()\n#\u202e{{ 7 * 7 }}\\'


def test_names_enter_as_literals_only():
    experiment = Experiment(HOSTILE, NOTHING, ((f"Rest for 1 second {HOSTILE}",),))
    cell = CellModel("Chen2020", options={HOSTILE: HOSTILE}, overrides={})
    text = script(task_of(cell, experiment, RADIUS), {RADIUS: 5e-6})
    tree = ast.parse(text)
    assert text.isascii()
    assert not any(line.strip().startswith("import os;") for line in text.splitlines())
    assigned = {node.targets[0].id: node.value for node in tree.body if isinstance(node, ast.Assign)}
    assert ast.literal_eval(assigned["RECORDS"])[0]["name"] == HOSTILE
    assert ast.literal_eval(assigned["OPTIONS"]) == {HOSTILE: HOSTILE}
    # Nothing but imports, constants, functions and the entry point.
    allowed = (ast.Import, ast.Assign, ast.FunctionDef, ast.Expr, ast.If)
    assert all(isinstance(node, allowed) for node in tree.body)


def test_an_effect_is_quoted_and_its_words_stay_comments():
    growth = next(effect for effect in EFFECTS if effect.name == "resistance-growth")
    hostile = replace(growth, title=HOSTILE, equation=HOSTILE, citation=HOSTILE)
    experiment = Experiment("life", NOTHING, (("Rest for 1 second",),))
    candidate = {RADIUS: 5e-6, growth.full_name(growth.strength): 0.25}
    text = script(task_of(CellModel("Chen2020", "SPM"), experiment, RADIUS), candidate, (hostile,))
    assert not any(line.strip().startswith("import os;") for line in text.splitlines())
    made = namespace_of(text, "script")
    assert made["model"]().options["contact resistance"] == "true"
    resistance = made["parameter_values"]()["Contact resistance [Ohm]"]
    assert "Throughput capacity" in str(resistance)


@pytest.mark.parametrize("value", [HOSTILE, {"ü": [1.5, None]}, {"long " * 40: ("a" * 200, True)}, {}])
def test_literals_keep_their_value(value):
    assert ast.literal_eval(literal(value)) == value


def test_scalars_factors_and_state_of_charge_are_told_apart():
    experiment = Experiment("x", NOTHING, (("Rest for 1 second",),), temperature_k=308.15)
    candidate = {RADIUS: 4e-6, EXCHANGE: 1.25, SOC: 0.625}
    text = script(task_of(CellModel("Chen2020"), experiment, *candidate), candidate)
    names = {node.targets[0].id: node.value for node in ast.parse(text).body if isinstance(node, ast.Assign)}
    assert ast.literal_eval(names["CALIBRATED"]) == {RADIUS: 4e-6}
    assert ast.literal_eval(names["FACTORS"]) == {EXCHANGE.removesuffix(" factor"): 1.25}
    record = ast.literal_eval(names["RECORDS"])[0]
    assert (record["initial_soc"], record["temperature_k"]) == (0.625, 308.15)


@pytest.mark.parametrize("experiment", [Experiment("x", NOTHING, (("Rest for 1 second",),)), DRIVEN])
def test_the_script_may_take_as_many_steps_as_the_run(experiment: Experiment) -> None:
    text = script(task_of(CellModel("Chen2020"), experiment, RADIUS), {RADIUS: 4e-6})
    (written,) = re.findall(r'"max_num_steps": (\d+)', text)
    assert int(written) >= (compiled.MAX_STEPS if experiment.protocol else driven_cell.MAX_STEPS)


def test_a_warm_cell_starts_at_its_own_temperature():
    experiment = Experiment("x", NOTHING, (("Rest for 1 second",),), temperature_k=298.15, initial_temperature_k=303.15)
    names = ("Ambient temperature [K]", "Initial temperature [K]")
    for given, starts_k in ((experiment, 303.15), (replace(experiment, initial_temperature_k=None), 298.15)):
        text = script(task_of(CellModel("Chen2020"), given, RADIUS), {RADIUS: 4e-6})
        values = namespace_of(text, "warm")["parameter_values"]()
        assert [values[name] for name in names] == [298.15, starts_k]


DISCHARGE_FIRST = ("Discharge at 1C until 3.0 V", "Rest for 10 minutes")
CHARGE = ("Charge at 0.5C until 4.0 V", "Hold at 4.0 V until C/5")

CASES = {
    "protocol": (
        CellModel("Prada2013", "SPMe", {"thermal": "lumped"}, {"Contact resistance [Ohm]": 0.0}),
        Experiment("cycle", NOTHING, ((*DISCHARGE_FIRST, "Charge at 1C until 3.5 V"),)),
        {"Negative particle radius [m]": 6e-6, "Separator thickness [m]": 2.2e-5, SOC: 0.9},
    ),
    "protocol of the DFN": (
        CellModel("Chen2020", "DFN"),
        Experiment("cycle", NOTHING, (DISCHARGE_FIRST, CHARGE), temperature_k=303.15),
        {RADIUS: 4.5e-6, EXCHANGE: 0.8},
    ),
    "measured current": (
        CellModel("Chen2020", "SPMe"),
        DRIVEN,
        {RADIUS: 4.5e-6, EXCHANGE: 0.8, "Current offset: drive [A]": 0.02},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_script_alone_gives_the_curve_of_the_final_score(case, tmp_path):
    cell, experiment, candidate = CASES[case]
    path = tmp_path / "best_parameters.py"
    path.write_text(script(task_of(cell, experiment, *candidate), candidate), encoding="utf-8")
    command = [sys.executable, "-I", path.name, "--csv", "curve.csv"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "A.h discharged" in done.stdout
    _, time, current, voltage = np.loadtxt(tmp_path / "curve.csv", delimiter=",", skiprows=1).T
    wanted = solve_reference(cell, experiment, change_of({key: target_named(key) for key in candidate}, candidate))
    assert wanted.failure is None
    assert abs(time[-1] - wanted.trajectory.duration) < 1e-2
    if experiment.protocol is None:
        # The score is taken at the record's samples, the script's curve at its own times.
        both = np.min(np.abs(time[:, None] - wanted.trajectory.time), axis=1) < 1e-6
        jumps = np.append(np.diff(time) < 1e-6, False)
        both &= ~jumps & ~np.roll(jumps, 1)  # which side the record shows is a convention
        assert np.count_nonzero(both) > 60
        time_of_both, voltage_of_both = time[both], voltage[both]
    else:
        time_of_both, voltage_of_both = time, voltage
    reference = wanted.trajectory
    assert largest_difference(time_of_both, voltage_of_both, reference.time, reference.voltage) < 1e-4
    assert abs(np.trapezoid(current, time) - np.trapezoid(wanted.trajectory.current, wanted.trajectory.time)) < 40.0


@pytest.mark.slow
@pytest.mark.parametrize("amperes", [5.0, 10.0])
def test_a_cell_that_runs_empty_before_its_record_ends_is_simulated_until_then(amperes, tmp_path):
    time = np.linspace(0.0, 3.0 * 18000.0 / amperes, 200)
    step = (Step(StepKind.CC_DISCHARGE, 0, len(time)),)
    record = Trajectory(time, np.full(len(time), amperes), np.full(len(time), 3.0), None, step)
    task = task_of(CellModel("Chen2020"), Experiment("deep", record, initial_soc=0.5), RADIUS)
    path = tmp_path / "best_parameters.py"
    path.write_text(script(task, {RADIUS: 5.22e-6}), encoding="utf-8")
    done = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert f"of {time[-1]:.0f} s: the simulated cell was empty or full there" in done.stdout
    reached = re.search(r"'deep': (\d+) s", done.stdout)
    assert reached is not None
    assert 0.2 < float(reached[1]) * amperes / 18000.0 < 0.6


@pytest.mark.slow
def test_a_protocol_that_cannot_be_followed_is_not_passed_over(tmp_path):
    experiment = Experiment("long", NOTHING, (("Discharge at 1C for 5 hours",),), initial_soc=0.5)
    path = tmp_path / "best_parameters.py"
    path.write_text(script(task_of(CellModel("Chen2020", "SPM"), experiment, RADIUS), {RADIUS: 5.22e-6}), "utf-8")
    done = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert "infeasible" in done.stdout + done.stderr


def test_lithium_of_a_cell_that_starts_where_its_set_does_is_in_the_script():
    experiment = Experiment("short", NOTHING, (("Discharge at 1C for 1 minute",),))
    task = task_of(CellModel("Chen2020", "SPM"), experiment, CYCLABLE_LITHIUM)
    made = namespace_of(script(task, {CYCLABLE_LITHIUM: 0.9}), "script")
    wanted = solve_reference(task.cell, experiment, task.space.change({CYCLABLE_LITHIUM: 0.9})).trajectory
    assert made["simulate"]()["Voltage [V]"].entries[-1] == pytest.approx(wanted.voltage[-1], abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("effects", [("ocp-shape.positive-electrode",), ()])
def test_a_start_by_voltage_is_that_of_the_final_score(effects):
    shape = {"ocp-shape: height [V]": 0.05, "ocp-shape: stoichiometry": 0.5} if effects else {}
    cell = CellModel("Mohtat2020", "SPM", {"thermal": "lumped"}, effects=effects)
    cold = Experiment("cold", NOTHING, (("Rest for 1 second",),), temperature_k=298.15, initial_voltage=3.8)
    cold = replace(cold, initial_temperature_k=273.15)
    made = namespace_of(script(task_of(cell, cold, RADIUS), {RADIUS: 5e-6, **shape}), "script")
    start = made["simulate"](0)["Voltage [V]"].entries[0]
    score = solve_reference(cell, cold, CellChange({RADIUS: 5e-6}, effects=shape)).trajectory
    assert start == pytest.approx(3.8, abs=1e-3)
    assert start == pytest.approx(score.voltage[0], abs=1e-4)


@pytest.mark.slow
def test_a_start_by_voltage_is_that_of_the_potentials_that_are_simulated():
    """A correction that is reduced so that the potential falls: the start was that of the potential as searched."""
    correction, cell = "Negative electrode OCP correction at stoichiometry 0.5 [V]", CellModel("Chen2020", "SPM")
    experiment = Experiment("short", NOTHING, (("Rest for 1 second",),), initial_voltage=3.8)
    made = namespace_of(script(task_of(cell, experiment, correction), {correction: -0.15}), "script")
    assert made["simulate"](0)["Voltage [V]"].entries[0] == pytest.approx(3.8, abs=1e-4)


@pytest.mark.slow
def test_what_an_effect_adds_to_the_voltage_is_in_the_scripts_cut_offs_and_impedance():
    cell = CellModel("Chen2020", "SPM", effects=("ocp-hysteresis",))
    candidate = {"ocp-hysteresis: half_gap [V]": 0.05, "ocp-hysteresis: decay": 20.0}
    spectrum = spectrum_record(ImpedanceSpectrum("z", np.logspace(1, -2, 5), np.full(5, 0.02 - 1e-3j)))
    cycle = Experiment("cycle", NOTHING, (("Discharge at 2C until 3.3 V",),), initial_soc=0.6)
    rest = Experiment("rest", spectrum, initial_soc=0.6)
    effects = effects_in(cell)
    space = ParameterSpace(tuple(parameter for effect in effects for parameter in effect.searched))
    made = namespace_of(script(Task("export", cell, space, (cycle, rest)), candidate), "script")
    assert made["simulate"](0)["Voltage [V]"].entries[-1] == pytest.approx(3.3, abs=1e-4)
    fitted = solve_reference(cell, rest, CellChange(effects=candidate)).trajectory
    assert made["impedance"](1)[-1, 2] == pytest.approx(-fitted.values("reactance")[-1], rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["self-discharge: leak [A]", "current-gain: gain"])
def test_what_an_effect_makes_of_the_current_is_in_the_script(name):
    cell = CellModel("Chen2020", "SPM", effects=(name.split(":")[0],))
    effects = effects_in(cell)
    space = ParameterSpace(tuple(parameter for effect in effects for parameter in effect.searched))
    experiment = Experiment("drive", drive_record(), initial_soc=0.6)
    made = namespace_of(script(Task("export", cell, space, (experiment,)), {name: 1.1}), "script")
    solution = made["simulate"]()
    wanted = solve_reference(cell, experiment, CellChange(effects={name: 1.1})).trajectory
    at = np.array([600.0, 1200.0, 1700.0])
    found = solution["Voltage [V]"](at)
    np.testing.assert_allclose(found, np.interp(at, wanted.time, wanted.voltage), atol=1e-4)
    through = experiment.target.current[60] + 1.1 if "leak" in name else 1.1 * experiment.target.current[60]
    assert solution["Current [A]"](600.0) == pytest.approx(through)


def test_the_mesh_that_an_effect_asks_for_is_in_the_script():
    cell = CellModel("Chen2020", "SPM", effects=("particle-size-distribution",))
    effects = effects_in(cell)
    experiment = Experiment("short", NOTHING, (("Discharge at 1C for 1 minute",),))
    space = ParameterSpace(tuple(parameter for effect in effects for parameter in effect.searched))
    text = script(Task("export", cell, space, (experiment,)), {"particle-size-distribution: deviation": 0.3})
    assert 'effects = {"R_n": 10, "R_p": 10}' in text


def largest_difference(time, values, reference_time, reference):
    """Where one step ends and the next begins two samples share a stamp: either may be the counterpart."""
    differences = []
    for moment, value in zip(time, values, strict=True):
        near = np.abs(reference_time - moment) < 1e-2
        # Holds are sampled at other times; their voltage is constant, so that interpolation is exact.
        others = reference[near] if near.any() else np.interp([moment], reference_time, reference)
        differences.append(np.min(np.abs(others - value)))
    return max(differences)


@pytest.mark.slow
def test_a_factor_of_what_an_override_made_a_number_is_in_the_script():
    diffusivity = "Negative particle diffusivity [m2.s-1]"
    cell = CellModel("OKane2022", "SPM", overrides={diffusivity: 3e-14})
    experiment = Experiment("r", NOTHING, (("Discharge at 1C for 60 s",),))
    factor = f"{diffusivity} factor"
    made = namespace_of(script(task_of(cell, experiment, factor), {factor: 2.0}), "script")
    assert made["parameter_values"]()[diffusivity] == pytest.approx(6e-14, abs=0.0)


def test_a_multiplier_on_what_a_person_gave_a_set_from_a_file_is_in_the_script():
    name = "Positive particle diffusivity [m2.s-1]"
    file = parsed("cell.json", parameter_values_json(CellModel("Chen2020"), CellChange()))
    cell = CellModel(file, "SPM", overrides={name: 3e-15})
    experiment = Experiment("short", NOTHING, (("Discharge at 1C for 1 minute",),))
    made = namespace_of(script(task_of(cell, experiment, f"{name} factor"), {f"{name} factor": 2.0}), "script")
    assert made["parameter_values"]()[name] == pytest.approx(6e-15, abs=0.0)
