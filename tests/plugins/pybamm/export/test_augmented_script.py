import ast
import builtins
import subprocess
import symtable
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from bsa.core.contracts.requests import MeasuredRecord
from bsa.core.effect import Effect, EffectParameter
from bsa.core.target import CellChange, target_named
from bsa.core.task import CellModel
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.effects.catalogue import EFFECTS
from bsa.plugins.pybamm.augmentation import PyBaMMPart
from bsa.plugins.pybamm.cells.parameter_files import parsed
from bsa.plugins.pybamm.export.augmented_script import augmented_script
from bsa.plugins.pybamm.export.calibrated_script import parameter_values_json
from bsa.plugins.pybamm.export.quoted_effects import quoted
from bsa.plugins.pybamm.modelling.compiled_cell import Start
from bsa.plugins.pybamm.solving.driven_cell import FINE, DrivenCell


def record():
    time = np.concatenate([np.arange(0.0, 60, 5), 60 + np.arange(0.0, 600, 5), 660 + np.arange(0.0, 300, 5)])
    current = np.concatenate([np.zeros(12), np.full(120, 5.0), np.zeros(60)])
    kinds = (StepKind.REST, StepKind.CC_DISCHARGE, StepKind.REST)
    steps = tuple(Step(kind, a, b) for kind, a, b in zip(kinds, (0, 12, 132), (12, 132, 192), strict=True))
    return Trajectory(time, current, np.full(len(time), 4.0), None, steps)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "keys"),
    [
        ("SPMe", ("contact-resistance", "ocp-hysteresis", "voltage-offset")),
        ("SPMe", ("self-heating", "time-lag")),
        ("DFN", ("contact-resistance",)),
    ],
)
def test_the_script_needs_pybamm_alone_and_gives_the_same_curve(tmp_path, model, keys):
    effects = tuple(e for e in EFFECTS if e.key in keys)
    driven = record()
    measured_record = MeasuredRecord("a", driven, 298.15)
    name = "Positive particle diffusivity [m2.s-1] factor"
    candidate = {measured_record.soc_name: 0.9, name: 0.8}
    for effect in effects:
        candidate |= {effect.full_name(p): p.probe for p in effect.parameters}
    cell = CellModel("Chen2020", model)
    path = tmp_path / "augmented_model.py"
    targets = {key: target_named(key) for key in [name, measured_record.soc_name]}
    path.write_text(augmented_script(cell, effects, candidate, targets, [measured_record]), encoding="utf-8")
    code = (
        "import sys; sys.modules['bsa'] = None\n"
        "import augmented_model as m, numpy as np\n"
        "t, v, k = m.simulate(0); np.save('v.npy', v)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    expected = DrivenCell(cell, effects, driven, {name: target_named(name)}, Start(temperature_k=298.15), FINE).solve(
        candidate, driven.time, driven.current, 0.9
    )
    assert expected is not None
    np.testing.assert_allclose(np.load(tmp_path / "v.npy"), expected.voltage, atol=2e-4)


def test_the_script_has_the_tolerances_of_the_discovery():
    """A tenth of the relative tolerance in place of the absolute one stops a DFN where the current first steps."""
    text = augmented_script(CellModel("Chen2020", "DFN"), (), {}, {}, [])
    assigned = {node.targets[0].id: node.value for node in ast.parse(text).body if isinstance(node, ast.Assign)}
    tolerances = [ast.literal_eval(assigned[f"{kind}_TOLERANCE"]) for kind in ("RELATIVE", "ABSOLUTE")]
    assert tolerances == [FINE.rtol, FINE.atol]


def test_a_set_from_a_file_stands_in_the_script(tmp_path):
    file = parsed(
        "cell.json", parameter_values_json(CellModel("Chen2020"), CellChange({"Separator thickness [m]": 2e-5}))
    )
    measured_record = MeasuredRecord("a", record(), 298.15)
    name = "Positive particle diffusivity [m2.s-1] factor"
    candidate = {measured_record.soc_name: 0.9, name: 0.8}
    targets = {key: target_named(key) for key in [name, measured_record.soc_name]}
    script = {"__name__": "augmented_model"}
    exec(augmented_script(CellModel(file, "SPM"), (), candidate, targets, [measured_record]), script)
    values = script["parameter_values"]()
    assert values["Separator thickness [m]"] == 2e-5
    assert np.isfinite(script["simulate"]()[1]).all()


def test_words_of_other_people_stay_comments_and_texts():
    effect = next(e for e in EFFECTS if e.key == "contact-resistance")
    breakout = 'x\nimport os; raise SystemExit("broken out")\r#\u2028"""\x1b[31m\u202e'
    strange = replace(effect, title=breakout, equation=breakout, citation=breakout)
    measured_record = MeasuredRecord(breakout, record(), 298.15)
    candidate = {strange.full_name(p): p.probe for p in strange.parameters} | {measured_record.soc_name: 0.9}
    cell = CellModel("Chen2020", "SPM")
    text = augmented_script(
        cell,
        (strange,),
        candidate,
        {measured_record.soc_name: target_named(measured_record.soc_name)},
        [measured_record],
    )
    plain = augmented_script(
        cell,
        (effect,),
        {effect.full_name(p): p.probe for p in effect.parameters} | {MeasuredRecord("a", record()).soc_name: 0.9},
        {key: target_named(key) for key in [MeasuredRecord("a", record()).soc_name]},
        [MeasuredRecord("a", record(), 298.15)],
    )
    assert {"\x1b", "\u202e", "\u2028", "\r"}.isdisjoint(text)
    assert "broken out" in text
    kinds = [[type(node) for node in ast.parse(source).body] for source in (text, plain)]
    assert kinds[0] == kinds[1]


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.key)
def test_what_is_quoted_of_an_effect_needs_nothing_else_of_this_package(effect):
    """An effect's function that calls a helper beside it would stop the script with a NameError."""
    source = quoted(1, effect, {})["source"]
    offered = {"np", "pybamm", "Any", "Mapping", "FloatArray", "Values", *dir(builtins)}
    table = symtable.symtable(source, "quoted", "exec")
    defined = {symbol.get_name() for symbol in table.get_symbols() if symbol.is_assigned()}
    assert source
    assert _globals_in(table) <= offered | defined


def _globals_in(table):
    """Names that code takes from outside itself."""
    found = {symbol.get_name() for symbol in table.get_symbols() if symbol.is_global() and symbol.is_referenced()}
    return found.union(*(_globals_in(child) for child in table.get_children()))


def _rate(name, known, p, unit):
    return {name: unit * p["rate"]}


def test_a_function_with_some_of_its_arguments_is_quoted_with_them():
    effect = Effect("a", "", "", (EffectParameter("rate", "", 0.0, 0.0, 1.0, 0.1),), "", "")
    effect = replace(effect, physics=PyBaMMPart(values=partial(_rate, "A 'b' [m]", unit=0.25)))
    script = {}
    exec(quoted(1, effect, {})["source"], script)
    assert script["values_1"]({}, {"rate": 2.0}) == {"A 'b' [m]": 0.5}


def test_an_option_that_is_a_pair_stays_one():
    measured_record = MeasuredRecord("a", record(), 298.15)
    cell = CellModel("Chen2020", "SPM", {"particle": ["Fickian diffusion", "uniform profile"]})
    text = augmented_script(cell, (), {measured_record.soc_name: 0.9}, {}, [measured_record])
    assigned = {node.targets[0].id: node.value for node in ast.parse(text).body if isinstance(node, ast.Assign)}
    assert ast.literal_eval(assigned["OPTIONS"])["particle"] == ("Fickian diffusion", "uniform profile")
