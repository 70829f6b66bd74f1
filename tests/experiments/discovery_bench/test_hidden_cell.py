"""Hidden cells share no code with what searches; at the truth both give the same curves."""

import ast
import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from bsa.core.contracts.effect_choice import effects_of
from bsa.core.effect import Evidence
from bsa.core.inference.observations import after_jumps
from bsa.core.segmentation import segment
from bsa.core.task import CellModel
from bsa.experiments import discovery_bench
from bsa.experiments.discovery_bench.draws import draw, draw_short, setting_of
from bsa.experiments.discovery_bench.hidden_cell import Hidden, measure
from bsa.experiments.discovery_bench.hidden_physics import EFFECTS, HiddenEffect
from bsa.experiments.discovery_bench.making import DESCRIPTION, make_cases, unseal
from bsa.experiments.discovery_bench.protocols import Step
from bsa.experiments.discovery_bench.simulated_case import make
from bsa.plugins.pybamm.modelling.compiled_cell import Start
from bsa.plugins.pybamm.modelling.resolution import Resolution
from bsa.plugins.pybamm.solving.driven_cell import DrivenCell

CELL = ("hidden_cell", "hidden_physics", "protocols", "draws")

CYCLE = [
    Step(1.0, 4500.0, until_v=3.0, period=60.0),
    Step(0.0, 300.0, period=60.0),
    Step(-1.0, 4500.0, until_v=4.2, period=60.0),
    Step(None, 2400.0, until_rate=0.05, period=60.0, hold_v=4.2),
    Step(0.0, 300.0, period=60.0),
]
PULSES = [
    Step(0.0, 300.0, period=10.0),
    Step(1.0, 900.0, until_v=2.5, period=5.0),
    Step(0.0, 600.0, period=5.0),
    Step(2.0, 20.0, until_v=2.5, period=0.2),
    Step(0.0, 60.0, period=0.5),
    Step(-1.0, 300.0, until_v=4.2, period=1.0),
    Step(0.0, 600.0, period=5.0),
]


@pytest.mark.parametrize("name", CELL)
def test_a_hidden_cell_is_built_without_what_it_tests(name):
    path = Path(discovery_bench.__file__).parent / f"{name}.py"
    imported = [node.module or "" for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
    allowed = {"__future__", "collections.abc", "dataclasses", "functools", "typing", "core.trajectory", *CELL}
    assert set(imported) <= allowed


def test_the_whole_catalogue_can_be_hidden_but_for_what_only_a_life_shows():
    short = [
        Evidence(model, {}, cycles=20, temperature_span_k=50.0, sampling_s=0.01) for model in ("SPM", "SPMe", "DFN")
    ]
    catalogue = [
        effect for effect in effects_of(None) if effect.lacks is None or not all(effect.lacks(shown) for shown in short)
    ]
    assert {effect.key for effect in EFFECTS} == {effect.key for effect in catalogue}
    strengths = {effect.key: effect.full_name(effect.strength) for effect in catalogue}
    assert {effect.key: effect.strength for effect in EFFECTS} == strengths


def test_two_hundred_cases_have_their_quotas_and_are_drawn_by_the_seed():
    cases = [draw(5, number) for number in range(200)]
    settings = [case.setting for case in cases]
    assert {s: settings.count(s) for s in set(settings)} == {"single": 120, "none": 40, "pair": 20, "outside": 20}
    assert settings != [setting_of(6, number) for number in range(200)]
    singles = [case.hidden for case in cases if case.setting == "single"]
    others = [draw(6, number).hidden for number in range(200) if setting_of(6, number) == "single"]
    assert len({hidden.effects[0].key for hidden in singles}) > 20
    assert {hidden.strengths[hidden.effects[0].strength] for hidden in singles}.isdisjoint(
        hidden.strengths[hidden.effects[0].strength] for hidden in others
    )
    offsets = [h.strengths[h.effects[0].strength] for h in (*singles, *others) if h.effects[0].name == "voltage-offset"]
    assert min(offsets) < 0 < max(offsets)
    assert 30 <= sum(case.hidden.model == "DFN" for case in cases) <= 70
    assert len({tuple(case.hidden.shifts) for case in cases}) > 150
    assert {len(case.protocols) - 1 for case in cases} == {1, 2, 3, 4}
    assert {case.hidden.heavy_tailed for case in cases} == {True, False}


def test_a_case_has_the_records_in_which_its_effect_can_be_seen():
    for number in range(200):
        case = draw(7, number)
        fitted = case.protocols[:-1]
        for effect in case.hidden.effects:
            assert case.hidden.model in effect.models
            if effect.records == "ageing":
                assert set(case.protocols) == {"ageing"}
            elif effect.records == "ambients" and "ageing" not in fitted:
                assert np.ptp(case.ambients_c[:-1]) >= 10.0
            elif "ageing" not in fitted and effect.records in ("thermal", "charge"):
                assert {"thermal": "fast", "charge": "cycle"}[effect.records] in fitted


def test_short_cases_hide_every_effect_in_turn():
    cases = [draw_short(8, number) for number in range(44)]
    hidden = [case.hidden.effects[0] for case in cases]
    assert [effect.key for effect in hidden[:22]] == [effect.key for effect in EFFECTS if "SPMe" in effect.models]
    assert hidden[22:] == hidden[:22]
    assert {case.hidden.model for case in cases} == {"SPMe"}
    for case, effect in zip(cases, hidden, strict=True):
        assert len(case.protocols) <= 3
        assert effect.records != "ambients" or np.ptp(case.ambients_c[:-1]) >= 10.0
        assert effect.records != "ageing" or set(case.protocols) == {"ageing"}
    strengths = [case.hidden.strengths[effect.strength] for case, effect in zip(cases, hidden, strict=True)]
    assert strengths[22:] != strengths[:22]


@pytest.mark.slow
def test_six_cycles_sampled_once_a_minute_do_not_drift():
    hidden = Hidden("Mohtat2020", "SPMe", noise_v=0.0)
    record, exact = measure(hidden, [Step(0.0, 300.0), *CYCLE * 6], 0.9, 298.15, np.random.default_rng(0))
    record = segment(record)
    cell = CellModel("Mohtat2020", "SPMe")
    curve = DrivenCell(cell, (), record, {}, Start(temperature_k=298.15)).solve({}, record.time, record.current, 0.9)
    assert curve is not None
    assert np.max(np.abs(record.voltage - exact)) <= 0.5e-4 + 1e-9
    error = np.abs(curve.voltage - record.voltage)
    last = record.time > record.time[-1] * 5 / 6
    assert np.median(error[last]) < 1.5e-3


@pytest.mark.slow
@pytest.mark.parametrize("parameter_set", ["Chen2020", "OKane2022"])
def test_what_is_hidden_is_not_the_mesh(parameter_set: str):
    rates = [0.0] * 5 + [2.4] * 10 + [0.0] * 10 + [-0.6] * 10 + [1.6] * 10 + [0.4] * 15
    slow = {"Positive particle diffusivity [m2.s-1]": 0.6, "Positive particle radius [m]": 1.1}
    curves = [
        measure(
            Hidden(parameter_set, "SPMe", shifts=slow, points=points),
            [Step(rates, 59.0, period=0.2)],
            0.9,
            298.15,
            np.random.default_rng(0),
        )[1]
        for points in (25, 100)
    ]
    assert np.sqrt(np.mean(np.square(curves[1] - curves[0]))) < 0.1e-3


@pytest.mark.slow
@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.key)
def test_the_catalogue_describes_the_hidden_cell(effect: HiddenEffect):
    strength = effect.null + float(np.sqrt(effect.low * effect.high))
    hidden = Hidden(
        "Chen2020", effect.models[0], (effect,), {effect.strength: strength}, noise_v=0.0, resolution_v=1e-6
    )
    steps = [Step(0.0, 300.0), *CYCLE * 3] if effect.records == "ageing" else PULSES
    ambient_k = 283.15 if effect.records == "ambients" or effect.key == "kinetics-marcus" else 298.15
    record = segment(measure(hidden, steps, 0.9, ambient_k, np.random.default_rng(0))[0])
    (known,) = (entry for entry in effects_of(None) if entry.key == effect.key)
    cell = CellModel("Chen2020", hidden.model)
    # The mesh of the hidden cell.
    radial_points = 60 if known.name == "particle-size-distribution" else 120
    resolution = Resolution(1e-7, 30, radial_points, standard_mesh=True, radial_stretch=4.0)
    driven = DrivenCell(cell, (known,), record, {}, Start(temperature_k=ambient_k), resolution)
    curve = driven.solve({effect.strength: strength}, after_jumps(record), record.current, 0.9)
    assert curve is not None
    error = np.sqrt(np.mean(np.square(curve.voltage - record.voltage)))
    # The catalogue resolves a distribution by ten sizes, and its Marcus kinetics have a floor.
    limit = {"particle-size-distribution": 0.4e-3, "kinetics-marcus": 0.6e-3}.get(effect.key, 0.3e-3)
    assert error < (1e-3 if effect.records == "ageing" else limit)


@pytest.mark.slow
def test_cases_are_made_once_and_say_nothing(tmp_path, monkeypatch):
    short = [Step(0.0, 100.0), Step(1.0, 300.0), Step(0.0, 300.0)]
    monkeypatch.setattr("bsa.experiments.discovery_bench.simulated_case.protocol", lambda *drawn: short)
    said: list[str] = []
    assert len(make_cases(tmp_path / "blind", make, 2, seed=11, listener=said.append)) == 2
    (more,) = make_cases(tmp_path / "blind", make, 3, seed=11)
    assert more.name == "case_003"
    assert set(unseal(tmp_path / "blind")) == {"case_001", "case_002", "case_003"}
    told = json.loads((more / DESCRIPTION).read_text())
    assert set(told) == {"parameters", "model", "records"}
    make_cases(tmp_path / "short", partial(make, drawn=draw_short), 1, seed=11)
    assert unseal(tmp_path / "short")["case_001"]["keys"] == [EFFECTS[0].key]
    with pytest.raises(Exception, match="cases of seed 11, not 12"):
        make_cases(tmp_path / "blind", make, 4, seed=12)


@pytest.mark.slow
def test_a_cell_that_no_reader_would_take_is_drawn_again(tmp_path, monkeypatch):
    short = [Step(0.0, 100.0), Step(1.0, 300.0), Step(0.0, 300.0)]
    monkeypatch.setattr("bsa.experiments.discovery_bench.simulated_case.protocol", lambda *drawn: short)
    measured = []

    def reversed_at_first(*arguments):
        record, exact = measure(*arguments)
        measured.append(record)
        return (record.changed(voltage=record.voltage - 5.0) if len(measured) == 1 else record), exact

    monkeypatch.setattr("bsa.experiments.discovery_bench.simulated_case.measure", reversed_at_first)
    said: list[str] = []
    make_cases(tmp_path / "blind", make, 1, seed=11, listener=said.append)
    assert said == ["case_001: draw 1 failed (ValueError)", "case_001 made"]
