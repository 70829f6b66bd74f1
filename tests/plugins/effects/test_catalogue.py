from types import SimpleNamespace

import numpy as np
import pybamm
import pytest
from bsa.core.contracts.effect_choice import effects_of
from bsa.core.effect import Effect, EffectParameter, Evidence
from bsa.core.errors import BsaError
from bsa.core.task import CellModel
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.effects.catalogue import EFFECTS, entries
from bsa.plugins.pybamm.augmentation import PyBaMMPart, augmented_cell
from bsa.plugins.pybamm.cells.ocp_shape import bump
from bsa.plugins.pybamm.modelling.compiled_cell import Start
from bsa.plugins.pybamm.modelling.drive import current_function
from bsa.plugins.pybamm.solving.driven_cell import DrivenCell
from scipy.optimize import brentq

NAMES = {
    "contact-resistance",
    "self-heating",
    "temperature-dependence",
    "double-layer-capacitance",
    "ocp-hysteresis",
    "ocp-shape",
    "particle-size-distribution",
    "resistive-reactant",
    "electrolyte-transport",
    "slow-active-material",
    "solid-diffusivity-variation",
    "stress-induced-diffusion",
    "kinetics-marcus",
    "sei-growth",
    "lithium-plating",
    "loss-of-active-material",
    "porosity-change",
    "resistance-growth",
    "self-discharge",
    "current-gain",
    "current-offset",
    "voltage-offset",
    "time-lag",
}


def test_the_names_are_a_public_contract():
    assert {effect.name for effect in EFFECTS} == NAMES
    assert len({effect.key for effect in EFFECTS}) == len(EFFECTS)
    assert len({entry.name for entry in entries()}) == len(EFFECTS)
    # The registry passes over names that it does not allow.
    assert {effect.key for effect in effects_of([*NAMES])} == {effect.key for effect in EFFECTS}


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.key)
def test_every_effect_says_what_it_is(effect):
    assert effect.equation
    assert effect.signature
    assert effect.citation
    assert effect.strength.probe != effect.strength.null
    assert effect.physics is not None or effect.measurement is not None
    assert [p.name for p in effect.searched] == [effect.full_name(p) for p in effect.parameters]


def test_an_effect_that_the_base_model_has_is_not_missing():
    has = Evidence("SPMe", {"thermal": "lumped", "contact resistance": "true", "SEI": "reaction limited"}, 9, 20.0, 1.0)
    reasons = {e.key: e.lacks(has) for e in EFFECTS if e.lacks is not None}
    for key in ("self-heating", "sei-growth (reaction-limited)", "electrolyte-transport"):
        assert reasons[key], key


def test_the_shape_of_a_potential_is_the_correction_that_a_calibration_searches():
    x = np.linspace(0.02, 0.98, 25)
    for effect in EFFECTS:
        if effect.name == "ocp-shape":
            known = {f"{which} electrode OCP [V]": np.zeros_like for which in ("Negative", "Positive")}
            (found,) = effect.physics.values(known, {"height": 0.01, "stoichiometry": 0.8}).values()
            assert found(x) == pytest.approx(0.01 * bump(x, 0.8))


def test_what_imitates_most_effects_is_considered_where_it_is_named():
    on_request = {"ocp-shape", "slow-active-material", "resistive-reactant"}
    assert not on_request & {effect.name for effect in effects_of(None)}
    assert {effect.name for effect in effects_of(["ocp-shape"])} == {"ocp-shape"}
    assert len(effects_of(["ocp-shape (positive electrode)"])) == 1


def test_ageing_needs_cycles():
    few = Evidence("SPMe", {}, 1, 0.0, 1.0)
    for effect in EFFECTS:
        if effect.name in ("sei-growth", "lithium-plating", "loss-of-active-material", "porosity-change"):
            assert effect.lacks is not None
            assert "cycles" in effect.lacks(few)


def test_a_life_is_asked_for_what_changes_from_cycle_to_cycle():
    named = {effect.name for effect in EFFECTS if effect.ages}
    ageing = {"sei-growth", "lithium-plating", "loss-of-active-material", "porosity-change", "resistance-growth"}
    assert named == ageing
    (growth,) = (effect for effect in EFFECTS if effect.name == "resistance-growth")
    assert "50 cycles" in growth.lacks(Evidence("SPMe", {}, 20, 0.0, 1.0))
    assert "3 cycles" in growth.lacks(Evidence("SPMe", {}, 2, 0.0, 1.0, life=True))
    assert not growth.lacks(Evidence("SPM", {}, 20, 0.0, 1.0, life=True))
    stressed = [effect for effect in EFFECTS if effect.variant.endswith("by stress")]
    assert all("50 cycles" in effect.lacks(Evidence("SPMe", {}, 20, 0.0, 1.0)) for effect in stressed)
    assert not any(effect.lacks(Evidence("SPM", {}, 200, 0.0, 1.0)) for effect in stressed)


def test_further_laws_of_sei_growth_need_a_life_and_cracks_a_model_that_loses_their_lithium():
    laws = {effect.variant: effect for effect in EFFECTS if effect.name == "sei-growth"}
    for variant in ("electron-migration-limited", "interstitial-diffusion-limited"):
        assert "50 cycles" in laws[variant].lacks(Evidence("SPM", {}, 20, 0.0, 1.0))
        assert not laws[variant].lacks(Evidence("SPM", {}, 200, 0.0, 1.0))
    cracks = laws["diffusion-limited on cracks too"]
    assert "no lithium" in cracks.lacks(Evidence("SPMe", {}, 200, 0.0, 1.0))
    assert "50 cycles" in cracks.lacks(Evidence("DFN", {}, 20, 0.0, 1.0))
    assert not cracks.lacks(Evidence("DFN", {}, 200, 0.0, 1.0))


def test_effects_that_contradict_each_other_are_refused():
    def asks(name, kinetics):
        part = PyBaMMPart(options={"intercalation kinetics": kinetics})
        return Effect(name, name, "", (EffectParameter("x", "", 0.0, 0.0, 1.0, 0.1),), "", "", physics=part)

    with pytest.raises(BsaError, match="different values"):
        augmented_cell(CellModel("Chen2020"), (asks("one", "linear"), asks("other", "Marcus")))


@pytest.mark.slow
@pytest.mark.parametrize("parameter_set", ["Chen2020", "ORegan2022"])
def test_clogged_pores_are_those_of_a_lower_porosity(parameter_set, monkeypatch):
    share, seconds = 0.85, np.array([1.0, 60.0, 300.0])

    def solved(change):
        values = pybamm.ParameterValues(parameter_set)
        change(values)
        values.update({"Current function [A]": values["Nominal cell capacity [A.h]"]})
        points = dict.fromkeys(("x_n", "x_s", "x_p", "r_n", "r_p"), 10)
        simulation = pybamm.Simulation(pybamm.lithium_ion.SPMe(), parameter_values=values, var_pts=points)
        return simulation.solve([0, 300], t_interp=seconds, initial_soc=0.9)["Voltage [V]"](seconds)

    def narrow(values):
        for domain in ("Negative electrode", "Separator", "Positive electrode"):
            values[f"{domain} porosity"] *= share

    def clog(values):
        # After as much charge as the cell holds.
        passed = pybamm.Scalar(values["Nominal cell capacity [A.h]"])
        with monkeypatch.context() as patch:
            patch.setattr(pybamm, "Variable", lambda name: passed)
            values.update(BY_KEY["porosity-change"].physics.values(values, {"loss": -np.log(share)}))

    plain, narrowed, clogged = (solved(change) for change in (lambda values: None, narrow, clog))
    assert plain[-1] - narrowed[-1] > 5e-3
    np.testing.assert_allclose(clogged, narrowed, atol=2e-4)


def test_bounds_of_an_effect_must_hold_its_null():
    with pytest.raises(BsaError, match="must lie in"):
        EffectParameter("x", "", 0.0, 1.0, 2.0, 1.5)


def record():
    time, current, steps = [], [], []
    count, start = 0, 0.0
    for rate, seconds in ((0.0, 60.0), (5.0, 900.0), (0.0, 600.0), (10.0, 20.0), (0.0, 200.0)):
        clock = start + np.arange(0.0, seconds, 2.0)
        time.append(clock)
        current.append(np.full(len(clock), rate))
        kind = StepKind.REST if rate == 0 else StepKind.CC_DISCHARGE
        steps.append(Step(kind, count, count + len(clock)))
        count, start = count + len(clock), start + seconds
    time = np.concatenate(time)
    return Trajectory(time, np.concatenate(current), np.full(len(time), 4.0), None, tuple(steps))


BY_KEY = {effect.key: effect for effect in EFFECTS}
SPME = CellModel("Chen2020", "SPMe")


def voltage(effects, driven, extra=None, cell=SPME):
    curve = DrivenCell(cell, effects, driven, {}).solve(extra or {}, driven.time, driven.current, 0.9)
    assert curve is not None
    return curve.voltage


@pytest.mark.slow
def test_a_contact_resistance_is_ohms_law():
    driven = record()
    effect = BY_KEY["contact-resistance"]
    name = effect.full_name(effect.strength)
    change = voltage((effect,), driven, {name: 0.01}) - voltage((), driven)
    # The sample at the instant of a jump stands on either side of it.
    middle = np.concatenate([np.arange(s.start + 2, s.stop - 2) for s in driven.steps])
    np.testing.assert_allclose(change[middle], -0.01 * driven.current[middle], atol=2e-5)


@pytest.mark.slow
def test_a_contact_resistance_adds_to_that_of_the_base_model():
    driven = record()
    effect = BY_KEY["contact-resistance"]
    cell = CellModel("Chen2020", "SPMe", {"contact resistance": "true"}, {"Contact resistance [Ohm]": 0.02})
    base, more = (
        voltage(effects, driven, {effect.full_name(effect.strength): 0.01}, cell) for effects in ((), (effect,))
    )
    middle = np.concatenate([np.arange(s.start + 2, s.stop - 2) for s in driven.steps])
    np.testing.assert_allclose((more - base)[middle], -0.01 * driven.current[middle], atol=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "key",
    [
        "ocp-hysteresis",
        "resistive-reactant (negative electrode)",
        "resistive-reactant (positive electrode)",
        "slow-active-material (negative electrode)",
        "slow-active-material (positive electrode)",
        "self-discharge",
        "current-gain",
        "current-offset",
        "voltage-offset",
        "time-lag",
    ],
)
def test_an_absent_effect_changes_nothing(key):
    driven = record()
    effect = BY_KEY[key]
    np.testing.assert_allclose(voltage((effect,), driven), voltage((), driven), atol=5e-5)


@pytest.mark.slow
@pytest.mark.parametrize("electrode", ["negative", "positive"])
def test_slow_material_adds_polarisation_that_relaxes_with_its_time(electrode):
    driven = record()
    effect = BY_KEY[f"slow-active-material ({electrode} electrode)"]
    share, time, lag = (effect.full_name(one) for one in effect.parameters)
    plain = voltage((), driven)
    quick, slow = (voltage((effect,), driven, {share: 0.1, time: tau, lag: 1.0}) - plain for tau in (60.0, 36000.0))
    rest = (driven.time > 1000) & (driven.time < 1500)
    discharge = (driven.time > 500) & (driven.time < 900)
    assert np.all(slow[discharge] < quick[discharge])
    assert np.all(quick[discharge] < 1e-4)
    # What has 60 s is over in a rest of nine minutes; what has ten hours has hardly begun.
    assert abs(quick[rest][-1]) < 0.02 * abs(quick[discharge][-1]) + 1e-4
    assert slow[rest][-1] < 0.5 * slow[discharge][-1]


def slow_material(monkeypatch, electrode, mean, slow, **values):
    """What the effect changes of the potential, and how fast the slow material follows, where U(x) = x."""
    given = {"c_max": 1.0, "c_init": pybamm.Scalar(mean), "D": lambda x, t: 1.0, "U": lambda x, t: x}
    names = (f"Average {electrode} particle stoichiometry", f"X-averaged {electrode} particle surface stoichiometry")
    variables = {name: pybamm.Scalar(mean) for name in names}
    variables["Volume-averaged cell temperature [K]"] = pybamm.Scalar(298.15)
    param = SimpleNamespace(domain_params={electrode: SimpleNamespace(prim=SimpleNamespace(**given))}, T_ref=298.15)
    model = SimpleNamespace(param=param, variables=variables, rhs={}, initial_conditions={})
    monkeypatch.setattr(pybamm, "Variable", lambda name: pybamm.Scalar(slow))
    effect = BY_KEY[f"slow-active-material ({electrode} electrode)"]
    change = effect.physics.voltage(model, {p.name: p.null for p in effect.parameters} | values)
    (speed,) = model.rhs.values()
    return float(change.evaluate()), float(speed.evaluate())


def test_the_slow_share_and_the_rest_together_hold_the_lithium(monkeypatch):
    share, mean, slow = 0.2, 0.5, 0.6
    change, _ = slow_material(monkeypatch, "positive", mean, slow, share=share)
    # A potential that is the stoichiometry: the change is that of the quick material.
    assert share * slow + (1 - share) * (mean + change) == pytest.approx(mean, abs=1e-5)


def test_slow_material_lags_hardly_more_at_a_higher_rate(monkeypatch):
    lag, tau, rate = 0.01, 3600.0, 1 / 7200

    def exchange(behind):
        return slow_material(monkeypatch, "negative", 0.5, 0.5 - behind, time=tau, reference_lag=lag)[1]

    # The lag that keeps up with a rate; five times the rate takes l ln(5) more.
    once, fast = (brentq(lambda behind, r=r: exchange(behind) - r, 0.0, 0.5) for r in (rate, 5 * rate))
    assert once == pytest.approx(lag * np.arcsinh(rate * tau / lag))
    assert fast - once == pytest.approx(lag * np.log(5), rel=1e-3)
    # A short lag is made up for in the time that the effect is told.
    assert exchange(1e-5) == pytest.approx(1e-5 / tau, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("kelvin", [278.15, 298.15, 318.15])
def test_marcus_kinetics_without_a_reorganisation_are_the_base_models_at_any_temperature(kelvin):
    driven = record()
    effect = BY_KEY["kinetics-marcus"]
    cell = CellModel("Chen2020", "SPM")
    curves = [
        DrivenCell(cell, effects, driven, {}, Start(temperature_k=kelvin)).solve({}, driven.time, driven.current, 0.9)
        for effects in ((), (effect,))
    ]
    assert all(curve is not None for curve in curves)
    # Of Butler-Volmer it differs by what its largest energy, 20 eV, still does at 2C.
    np.testing.assert_allclose(curves[1].voltage, curves[0].voltage, atol=1e-3)


def third_party_voltage(model, p):
    return -p["size"] * model.variables["Current [A]"] ** 3 / 1000


@pytest.mark.slow
def test_a_third_party_writes_an_effect_as_an_expression():
    driven = record()
    part = PyBaMMPart(voltage=third_party_voltage)
    effect = Effect("cubic", "", "", (EffectParameter("size", "V.A-3", 0.0, 0.0, 1.0, 0.1),), "", "", physics=part)
    change = voltage((effect,), driven, {effect.full_name(effect.strength): 0.02}) - voltage((), driven)
    middle = (driven.time > 100) & (driven.time < 900)
    np.testing.assert_allclose(change[middle], -0.02 * 125 / 1000, atol=2e-5)


@pytest.mark.slow
def test_the_measured_current_is_followed_through_a_short_pulse():
    driven = record()
    fast = voltage((), driven)
    pulse = (driven.time > 1562) & (driven.time < 1578)
    rest = (driven.time > 1500) & (driven.time < 1558)
    assert fast[rest].min() - fast[pulse].max() > 0.1


def test_a_step_begins_where_the_one_before_logged_its_last_sample():
    time = np.array([0.0, 10.0, 60.0, 90.0, 120.0])
    current = np.array([0.0, 0.0, 2.0, 2.0, 2.0])
    steps = (Step(StepKind.REST, 0, 2), Step(StepKind.CC_DISCHARGE, 2, 5))
    function = current_function(Trajectory(time, current, np.full(5, 3.7), None, steps))
    at = np.interp([9.9, 10.0, 10.1, 59.0], function.time, function.current)
    assert list(at) == [0.0, 0.0, 2.0, 2.0]
    assert 10.0 in function.stops


def test_a_cell_that_runs_empty_pauses_until_the_current_turns():
    time = np.concatenate([np.arange(0.0, 6000, 30), np.arange(6000.0, 9000, 30)])
    current = np.where(time < 6000, 4.0, -2.0)
    steps = (Step(StepKind.CC_DISCHARGE, 0, 200), Step(StepKind.CC_CHARGE, 200, 300))
    record = Trajectory(time, current, np.full(300, 3.7), None, steps)
    driven = DrivenCell(CellModel("Chen2020", "SPM"), (), record, {})
    curves = [driven.solve({}, time, current, soc) for soc in (0.5, 0.501)]
    assert curves[0] is not None
    assert curves[1] is not None
    # Empty for the rest of the discharge, then charged from there; and a little more charge changes a little.
    assert curves[0].voltage[199] == 2.0  # half a volt below the cut-off
    assert curves[0].voltage[-1] > 3.0
    assert np.max(np.abs(curves[1].voltage - curves[0].voltage)[201:]) < 0.03


def test_a_cell_that_runs_empty_in_every_cycle_is_followed_to_the_end():
    # Each of six cycles draws more than the cell holds.
    one = np.concatenate([np.full(100, 5.0), np.full(100, -4.0)])
    current, time = np.tile(one, 6), 35.0 * np.arange(1200)
    kinds = (StepKind.CC_DISCHARGE, StepKind.CC_CHARGE) * 6
    steps = tuple(Step(kind, 100 * k, 100 * (k + 1)) for k, kind in enumerate(kinds))
    record = Trajectory(time, current, np.full(1200, 3.7), None, steps)
    driven = DrivenCell(CellModel("Chen2020", "SPM"), (), record, {})
    curves = [driven.solve({}, time, current, soc) for soc in (0.5, 0.501)]
    assert all(curve is not None for curve in curves)
    for cycle in range(6):
        discharge = curves[0].voltage[200 * cycle : 200 * cycle + 100]
        assert discharge[5] > 3.0
        assert discharge[-1] == 2.0
    assert np.mean(np.abs(curves[1].voltage - curves[0].voltage)) < 0.02
