"""The simulator of a discovery: a cheaper model beside the base model, and the check on mesh and tolerances."""

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.contracts.requests import MeasuredRecord, Moments, Request
from bsa.core.target import target_named
from bsa.core.task import CellModel
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.effects.catalogue import EFFECTS
from bsa.plugins.pybamm.modelling.compiled_cell import CompiledCell
from bsa.plugins.pybamm.simulators.effect_simulator import EffectSimulator

BUILD = CompiledCell.built_model
NAME = "Positive particle diffusivity [m2.s-1] factor"
(RESISTANCE,) = (effect for effect in EFFECTS if effect.key == "contact-resistance")


@pytest.fixture(scope="module")
def request_of():
    rest, drawn = np.arange(0.0, 1201.0, 20.0), np.arange(1220.0, 4000.0, 20.0)
    time, current = np.concatenate([rest, drawn]), np.repeat([0.0, 5 / 3], [len(rest), len(drawn)])
    steps = (Step(StepKind.REST, 0, len(rest)), Step(StepKind.CC_DISCHARGE, len(rest), len(time)))
    record = Trajectory(time, current, np.full(len(time), 3.8), None, steps)
    strength = RESISTANCE.full_name(RESISTANCE.strength)
    moments = Moments.single(time, current)
    return Request((RESISTANCE,), {NAME: 1.0, strength: 0.01}, MeasuredRecord("a", record, 298.15), moments, soc=0.9)


@pytest.fixture(scope="module")
def slower(request_of):
    """The same of half the current, sampled half as often."""
    record = request_of.measured_record.record
    time, current = record.time[::2], 0.5 * record.current[::2]
    count = int(np.sum(current == 0))
    steps = (Step(StepKind.REST, 0, count), Step(StepKind.CC_DISCHARGE, count, len(time)))
    second = MeasuredRecord("b", Trajectory(time, current, np.full(len(time), 3.8), None, steps), 298.15)
    return replace(request_of, measured_record=second, moments=Moments.single(time, current))


def voltages(model, *requests):
    found = EffectSimulator(CellModel("Chen2020", model), {NAME: target_named(NAME)}).predict(requests)
    return [prediction.voltage for prediction in found]


@pytest.mark.slow
def test_beside_dfn_the_cheaper_model_is_spme_with_the_same_effects(request_of):
    usual, low = voltages("DFN", request_of, replace(request_of, low_fidelity=True))
    (spme,) = voltages("SPMe", request_of)
    np.testing.assert_array_equal(low, spme)
    assert 1e-4 < np.max(np.abs(usual - low)) < 0.1
    targets = {NAME: target_named(NAME)}
    assert EffectSimulator(CellModel("Chen2020", "DFN"), targets).has_low_fidelity
    assert not EffectSimulator(CellModel("Chen2020", "SPMe"), targets).has_low_fidelity


def test_a_current_is_offset_for_a_request_wherever_one_passes(request_of):
    bare = replace(request_of, effects=(), candidate={NAME: 1.0})
    measured = bare.measured_record
    current = measured.record.current
    moved = measured.record.changed(current=np.where(current == 0.0, 0.0, current + 0.02))
    none, shifted = voltages("SPM", bare, replace(bare, offset=0.02))
    (wanted,) = voltages("SPM", replace(bare, measured_record=replace(measured, record=moved)))
    np.testing.assert_allclose(shifted, wanted, atol=1e-5)
    assert np.max(np.abs(shifted - none)) > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("model", ["SPMe", "DFN"])
def test_mesh_and_tolerances_can_be_checked(model, request_of):
    usual, fine = voltages(model, request_of, replace(request_of, fine=True))
    assert 0 < np.max(np.abs(usual - fine)) < 0.01


@pytest.mark.slow
def test_one_compiled_model_serves_several_records_as_models_of_their_own_do(request_of, slower, monkeypatch):
    warm = MeasuredRecord("c", request_of.measured_record.record, 308.15)
    second = slower.measured_record
    begun_warm = replace(request_of.measured_record, name="d", initial_k=308.15)
    others = [replace(request_of, measured_record=one) for one in (warm, begun_warm)]
    requests = [request_of, slower, *others]
    cell, targets = CellModel("Chen2020", "SPMe"), {NAME: target_named(NAME)}
    apart = EffectSimulator(cell, targets).predict(requests)
    built = []
    monkeypatch.setattr(CompiledCell, "built_model", lambda self: built.append(self) or BUILD(self))
    together = EffectSimulator(cell, targets, together=[request_of.measured_record, second, warm, begun_warm]).predict(
        requests
    )
    assert len(built) == 3  # another temperature, around the cell or at its start, is another model
    for one, other in zip(apart, together, strict=True):
        np.testing.assert_allclose(one.voltage, other.voltage, atol=2e-5)
        np.testing.assert_allclose(one.temperature, other.temperature, atol=1e-3)


def test_an_answer_does_not_depend_on_which_record_was_asked_for_first(request_of, slower):
    cell, targets = CellModel("Chen2020", "SPM"), {NAME: target_named(NAME)}
    requests = [request_of, slower]
    records = [request.measured_record for request in requests]
    there, back = (EffectSimulator(cell, targets, together=records) for _ in range(2))
    for one, other in zip(there.predict(requests), back.predict(requests[::-1])[::-1], strict=True):
        np.testing.assert_array_equal(one.voltage, other.voltage)
