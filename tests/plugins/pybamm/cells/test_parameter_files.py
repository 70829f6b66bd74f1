"""Parameter sets from files: BPX, PyBaMM's own JSON, a calibrated cell; and what a file may not do."""

import json
import math

import numpy as np
import pytest
from bsa.core.encoding import decode_task, encode_parameter, encode_task
from bsa.core.errors import BsaError
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.target import CYCLABLE_LITHIUM, target_named
from bsa.core.task import CellModel, Experiment, ParameterFile, Task
from bsa.core.trajectory import Trajectory
from bsa.plugins.pybamm.cells.nameplate import nominal_capacity_ah
from bsa.plugins.pybamm.cells.parameter_files import COOLING, as_json, expression, parsed
from bsa.plugins.pybamm.cells.parameter_sets import bake, load, pybamm, states
from hypothesis import given
from hypothesis import strategies as st

CONDUCTIVITY = "Electrolyte conductivity [S.m-1]"
OCP = "Negative electrode OCP [V]"


def bpx_content() -> dict:
    """A small BPX file with a constant, an expression and a table."""
    electrode = {
        "Particle radius [m]": 5e-6,
        "Thickness [m]": 7e-5,
        "Diffusivity [m2.s-1]": 4e-14,
        "Conductivity [S.m-1]": 10.0,
        "Surface area per unit volume [m-1]": 4e5,
        "Porosity": 0.3,
        "Transport efficiency": 0.16,
        "Reaction rate constant [mol.m-2.s-1]": 1e-5,
        "Minimum stoichiometry": 0.02,
        "Maximum stoichiometry": 0.85,
        "Maximum concentration [mol.m-3]": 30000.0,
        "Entropic change coefficient [V.K-1]": 0.0,
    }
    x = np.linspace(0.0, 1.0, 50)
    return {
        "Header": {"BPX": "1.1.0", "Model": "DFN"},
        "Parameterisation": {
            "Cell": {
                "Electrode area [m2]": 0.1,
                "External surface area [m2]": 0.04,
                "Volume [m3]": 1e-4,
                "Number of electrode pairs connected in parallel to make a cell": 1,
                "Lower voltage cut-off [V]": 2.5,
                "Upper voltage cut-off [V]": 4.4,
                "Nominal cell capacity [A.h]": 3.0,
                "Reference temperature [K]": 298.15,
            },
            "Electrolyte": {
                "Cation transference number": 0.26,
                "Conductivity [S.m-1]": "0.1297 * (x / 1000) ** 3 - 2.51 * (x / 1000) ** 1.5 + 3.329 * (x / 1000)",
                "Diffusivity [m2.s-1]": 3e-10,
            },
            "Negative electrode": {**electrode, "OCP [V]": "0.1 + 0.7 * exp(-30 * x) - 0.02 * tanh(8 * (x - 0.5))"},
            "Positive electrode": {
                **electrode,
                "Minimum stoichiometry": 0.2,
                "Maximum stoichiometry": 0.95,
                "Maximum concentration [mol.m-3]": 40000.0,
                "OCP [V]": {"x": x.tolist(), "y": (4.4 - 1.0 * x).tolist()},
            },
            "Separator": {"Thickness [m]": 2e-5, "Porosity": 0.5, "Transport efficiency": 0.35},
        },
    }


def end_voltage(values) -> float:
    model = pybamm.lithium_ion.SPM()
    return float(pybamm.Simulation(model, parameter_values=values).solve([0, 900])["Voltage [V]"].entries[-1])


@pytest.mark.filterwarnings("ignore")
def test_a_bpx_file_gives_what_pybamm_makes_of_it() -> None:
    ours = load(parsed("cell.json", json.dumps(bpx_content())))
    theirs = pybamm.ParameterValues.create_from_bpx_obj(bpx_content())
    assert end_voltage(ours) == pytest.approx(end_voltage(theirs), abs=1e-9)
    assert ours["SEI resistivity [Ohm.m]"] == load("Chen2020")["SEI resistivity [Ohm.m]"]  # a gap, filled


@pytest.mark.slow
@pytest.mark.parametrize(("coefficient", "taken"), [(None, 10.0), (25.0, 25.0), (0.0, 0.0)])
def test_a_bpx_file_that_does_not_say_how_its_cell_is_cooled_is_not_adiabatic(coefficient, taken) -> None:
    content = bpx_content()
    initial = {"Initial state-of-charge": 1.0, "Initial temperature [K]": 298.15}
    around = {"Ambient temperature [K]": 298.15}
    if coefficient is not None:
        around["Heat transfer coefficient [W.m-2.K-1]"] = coefficient
    file = parsed(
        "cell.json", json.dumps({**content, "State": {"Initial conditions": initial, "Thermal environment": around}})
    )
    assert load(file)[COOLING] == taken
    assert states(file, COOLING) == (coefficient is not None)


def test_a_file_travels_whole_with_its_task() -> None:
    file = parsed("cell.json", json.dumps({**bpx_content(), "Validation": {"long": [1.0] * 9}}))
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    space = ParameterSpace((Parameter("Separator porosity", 0.5, 0.3, 0.7),))
    task = Task("t", CellModel(file), space, (Experiment("r", nothing, (("Rest for 1 hour",),)),))
    again = decode_task(json.loads(json.dumps(encode_task(task))))
    assert again.cell.parameter_set == file
    assert str(again.cell.parameter_set) == "cell.json"
    assert "Validation" not in file.text
    assert load(again.cell.parameter_set)["Separator porosity"] == 0.5


@pytest.mark.slow
def test_pybamm_s_own_json_gives_the_set_back_and_its_functions_can_be_searched() -> None:
    text = json.dumps(pybamm.ParameterValues("Chen2020").to_json())
    file = parsed("chen.json", text)
    values = load(file)
    assert end_voltage(values) == pytest.approx(end_voltage(load("Chen2020")), abs=1e-5)
    chen = load("Chen2020")
    space = ParameterSpace((Parameter(f"{OCP} factor", 1.0, 0.5, 2.0, target=target_named(f"{OCP} factor")),))
    for one in (values, chen):
        bake(one, space.change({f"{OCP} factor": 1.2}))
    assert end_voltage(values) == pytest.approx(end_voltage(chen), abs=1e-5)
    # Scaled functions, of a set and of BPX with arguments bound, can be written again.
    assert end_voltage(load(parsed("again.json", json.dumps(values.to_json())))) == pytest.approx(
        end_voltage(values), abs=1e-5
    )


def test_a_calibrated_cell_is_a_set_of_its_own() -> None:
    names = ("Electrode width [m]", f"{CONDUCTIVITY} factor", CYCLABLE_LITHIUM)
    space = ParameterSpace(tuple(Parameter(name, 1.0, 0.5, 2.0, target=target_named(name)) for name in names))
    candidate = dict(zip(names, (1.7, 0.8, 0.97), strict=True))
    cell = {"parameter_set": "Chen2020", "model": "SPM", "options": {}, "overrides": {"Separator porosity": 0.44}}
    text = json.dumps({"cell": cell, "space": [encode_parameter(p) for p in space], "candidate": candidate})
    values = load(ParameterFile("run", "calibrated", text))
    base = load("Chen2020")
    assert (values["Electrode width [m]"], values["Separator porosity"]) == (1.7, 0.44)
    at = (pybamm.Scalar(1000.0), pybamm.Scalar(298.15))
    assert values[CONDUCTIVITY](*at).evaluate() == pytest.approx(0.8 * base[CONDUCTIVITY](*at).evaluate())
    positive = "Initial concentration in positive electrode [mol.m-3]"
    assert values[positive] < base[positive]


def test_the_nominal_capacity_of_a_calibrated_cell_is_that_of_its_size() -> None:
    width = "Electrode width [m]"
    area = {width: 0.22 * float(load("Chen2020")[width])}  # a cell of 1.1 A.h
    cell = {"parameter_set": "Chen2020", "model": "SPM", "options": {}, "overrides": area}
    parameter = Parameter(CYCLABLE_LITHIUM, 1.0, 0.5, 2.0, target=target_named(CYCLABLE_LITHIUM))
    content = {"cell": cell, "space": [encode_parameter(parameter)], "candidate": {CYCLABLE_LITHIUM: 1.0}}
    found = ParameterFile("run", "calibrated", json.dumps(content))
    assert load(found)["Nominal cell capacity [A.h]"] == pytest.approx(1.1)
    assert nominal_capacity_ah(found, {}) == pytest.approx(1.1)


@given(st.floats(0.01, 0.99))
def test_an_expression_is_computed_as_python_would(x: float) -> None:
    text = "9.47e-01 * exp(-1.5e+02 * x) - -0.5 + tanh(2 - x) / cosh(x) ** 2 ** 0.5"
    expected = 9.47e-01 * math.exp(-1.5e02 * x) + 0.5 + math.tanh(2 - x) / math.cosh(x) ** 2**0.5
    assert float(expression(text)(pybamm.Scalar(x)).evaluate()) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    "text",
    [
        "exit(1)",
        "__import__('os').system('touch /tmp/x')",
        "x.__class__",
        "exp(x, x)",
        "exp(x=1)",
        "[x for x in (1,)]",
        "lambda: 1",
        "x if x else 1",
        "open(x)",
        "'a'",
        "True",
        "1 +",
        "(" * 300 + "x" + ")" * 300,
        "+".join(["-" * 200 + "x"]),
    ],
)
def test_an_expression_that_is_more_than_arithmetic_is_refused(text: str) -> None:
    with pytest.raises(BsaError):
        expression(text)


def test_numbers_cannot_grow_without_limit() -> None:
    with pytest.raises(OverflowError):
        expression("9 ** 9 ** 9 ** 9")(1.0)


def hostile_bpx(text: str) -> str:
    content = bpx_content()
    content["Parameterisation"]["Negative electrode"]["OCP [V]"] = text
    return json.dumps(content)


@pytest.mark.parametrize("text", ["exit(1)", "eval(x)", "9**9**9**9", "x" * 20_000, "(" * 2000])
def test_a_hostile_bpx_file_is_refused_in_a_line(text: str, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    if text == "9**9**9**9":
        # Arithmetic it is; the model then cannot be built from it.
        file = parsed("cell.json", hostile_bpx(text))
        with pytest.raises(OverflowError):
            load(file)[OCP](pybamm.Scalar(0.5))
    else:
        with pytest.raises(BsaError) as refused:
            parsed("cell.json", hostile_bpx(text))
        assert "\n" not in str(refused.value)
    assert not list(tmp_path.iterdir())  # no source file was written to be imported


@pytest.mark.parametrize(
    "node",
    [
        {"$type": "subprocess.Popen", "args": ["touch", "/tmp/x"]},
        {"type": "os.system", "children": []},
        {"py/object": "pybamm.lithium_ion.DFN"},
        {"module": "os", "class": "system"},
        {"$type": "pybamm.expression_tree.functions.Function", "children": []},
        {"$type": "pybamm.expression_tree.scalar.Scalar", "value": {"$type": "os.system"}},
        ["text"],
        "exit(1)",
        True,
    ],
)
def test_a_node_that_is_no_arithmetic_is_refused(node: object) -> None:
    content = {**json.loads(json.dumps(pybamm.ParameterValues("Chen2020").to_json())), OCP: node}
    with pytest.raises(BsaError) as refused:
        parsed("set.json", json.dumps(content))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "not valid JSON"),
        ("[1]", "holds no JSON object"),
        ('{"a": NaN}', "NaN is no number"),
        ('{"Electrode width [m]": 1.5}', "no whole parameter set"),
        ('{"Header": {"BPX": "1.1.0", "Model": "DFN"}, "Parameterisation": {}}', "does not read as BPX"),
    ],
)
def test_what_is_no_parameter_set_is_refused(text: str, words: str) -> None:
    with pytest.raises(BsaError, match=words):
        parsed("x.json", text)


def test_a_script_holds_the_set_of_a_file_and_gives_the_same_curve() -> None:
    from bsa.core.target import CellChange
    from bsa.plugins.pybamm.export.calibrated_script import script
    from bsa.plugins.pybamm.solving.experiment_kinds import solve_reference

    file = parsed("cell.json", json.dumps(bpx_content()))
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    experiment = Experiment("r", nothing, (("Discharge at 1C for 10 minutes",),), initial_soc=0.8)
    names = ("Negative particle radius [m]", f"{OCP} factor")
    space = ParameterSpace(tuple(Parameter(name, 1.0, 1e-9, 9.0, target=target_named(name)) for name in names))
    task = Task("t", CellModel(file, "SPM"), space, (experiment,))
    candidate = dict(zip(names, (6e-6, 1.1), strict=True))
    namespace: dict = {"__name__": "exported"}
    exec(compile(script(task, candidate), "<exported>", "exec"), namespace)
    found = namespace["simulate"]()["Voltage [V]"].entries
    change = space.change(candidate)
    assert isinstance(change, CellChange)
    run = solve_reference(task.cell, experiment, change)
    assert run.trajectory is not None
    assert found[-1] == pytest.approx(run.trajectory.voltage[-1], abs=1e-5)


def test_a_file_that_does_not_say_when_its_cell_is_empty_or_full_means_its_own_cut_offs() -> None:
    content = json.loads(as_json(load("Prada2013")))
    for percent in (0, 100):
        del content[f"Open-circuit voltage at {percent}% SOC [V]"]
    values = load(parsed("lfp.json", json.dumps(content)))
    # Not 2.5 and 4.2 V, those of the set that gaps are filled from.
    assert values["Open-circuit voltage at 0% SOC [V]"] == 2.0
    assert values["Open-circuit voltage at 100% SOC [V]"] == 3.6
