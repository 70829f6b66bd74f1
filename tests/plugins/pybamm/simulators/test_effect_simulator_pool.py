"""Simulations of a discovery in worker processes."""

import numpy as np
import pytest
from bsa.core.contracts.requests import MeasuredRecord, Moments, Request
from bsa.core.effect import Effect
from bsa.core.errors import BsaError
from bsa.core.target import target_named
from bsa.core.task import CellModel
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.effects.catalogue import EFFECTS
from bsa.plugins.pybamm.augmentation import PyBaMMPart
from bsa.plugins.pybamm.simulators.effect_simulator import EffectSimulator
from bsa.plugins.pybamm.simulators.effect_simulator_pool import EffectSimulatorPool
from bsa.plugins.pybamm.solving.driven_cell import FINE, SEARCH

pytestmark = pytest.mark.slow

CELL = CellModel("Chen2020", "SPM")
NAME = "Positive particle diffusivity [m2.s-1] factor"
(RESISTANCE,) = (effect for effect in EFFECTS if effect.key == "contact-resistance")


@pytest.fixture(scope="module")
def requests():
    time = np.arange(0.0, 600.0, 10.0)
    steps = (Step(StepKind.CC_DISCHARGE, 0, len(time)),)
    record = Trajectory(time, np.full(len(time), 5.0), np.full(len(time), 3.8), None, steps)
    measured_record, moments = MeasuredRecord("a", record, 298.15), Moments.single(time, record.current)
    strength = RESISTANCE.full_name(RESISTANCE.strength)
    candidates = [{NAME: factor, strength: 0.01 * factor} for factor in (0.5, 1.0, 2.0)]
    return [Request((RESISTANCE,), candidate, measured_record, moments, soc=0.9) for candidate in candidates]


@pytest.fixture(scope="module")
def pool():
    pool = EffectSimulatorPool(CELL, {NAME: target_named(NAME)}, SEARCH, FINE, 2)
    yield pool
    pool.close()


def test_workers_answer_what_a_simulator_in_this_process_answers(pool, requests):
    here = EffectSimulator(CELL, {NAME: target_named(NAME)}).predict(requests)
    there = pool.predict(requests)
    for ours, theirs in zip(here, there, strict=True):
        np.testing.assert_allclose(theirs.voltage, ours.voltage, atol=1e-9)
        np.testing.assert_allclose(theirs.temperature, ours.temperature, atol=1e-9)
    assert pool.simulations == 3


def test_a_worker_that_dies_costs_one_simulation(pool, requests):
    pool.predict(requests)
    pool._pool.workers[0]._process.kill()
    assert sum(prediction is None for prediction in pool.predict(requests)) == 1
    assert None not in pool.predict(requests)


def test_an_effect_that_cannot_be_sent_is_the_authors_error(pool, requests):
    part = PyBaMMPart(voltage=lambda model, p: 0.0)
    lambdas = Effect("own", "own", "", RESISTANCE.parameters, "", "", physics=part)
    request = Request((lambdas,), requests[0].candidate, requests[0].measured_record, requests[0].moments)
    with pytest.raises(BsaError, match="own cannot be sent") as caught:
        pool.predict([request])
    assert "top level of a module" in caught.value.hint
