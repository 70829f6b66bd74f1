from dataclasses import replace

import discovery_toy as toy
import numpy as np
import pytest
from bsa.core.contracts.requests import Prediction
from bsa.core.errors import BsaError
from bsa.core.inference.observations import observe, subset
from bsa.core.inference.problem import Problem


class Stairs(toy.ToySimulator):
    """Two meshes that fall in stairs from some moment on, and cross again and again."""

    def __init__(self, begin, height):
        self.begin, self.height = begin, height

    def one(self, request):
        times = request.moments.time
        fall = np.where(times > self.begin, np.sin(np.arange(len(times))), 0.0)
        return Prediction(super().one(request).voltage + request.fine * self.height * request.moments.averaged(fall))


def test_the_knee_of_a_discharge_is_never_the_whole_of_what_is_held_out():
    whole = toy.measured_record("a", np.random.default_rng(0), {})
    observed = observe(whole, points=150)
    flat = replace(observed, voltage=np.linspace(4.0, 3.9, len(observed)))
    turn = np.arange(len(observed)) // 6 % 5
    (usual,) = Problem(toy.ToySimulator(), [flat]).fitted
    assert np.array_equal(usual, turn != 2)
    knee = flat.voltage - np.where(np.arange(len(observed)) >= np.flatnonzero(turn == 2)[-6], 1.0, 0.0)
    (moved,) = Problem(toy.ToySimulator(), [replace(observed, voltage=knee)]).fitted
    assert np.count_nonzero(~moved) == pytest.approx(np.count_nonzero(~usual), abs=6)
    assert np.sum(np.abs(np.gradient(knee))[~moved]) < 0.1


@pytest.mark.parametrize("height", [0.002, 0.1])
def test_a_mesh_is_trusted_no_more_where_two_of_them_happen_to_cross(height):
    whole = toy.measured_record("a", np.random.default_rng(0), {})
    observed = observe(whole, points=10_000)
    problem = Problem(Stairs(1800.0, height), [observed])
    problem.correct_mesh((), {"resistance factor": 1.0, whole.soc_name: 0.9})
    added, late = problem.mesh_sigma["a"], observed.time > 1900.0
    assert np.all(added[late] > 0.2 * height)
    assert np.all(added[observed.time < 1700.0] == 0.0)
    # What is feared is not corrected.
    assert np.any(problem.corrections["a"]) == (height < 0.02)


def test_a_mesh_correction_is_not_measured_again_where_it_was_measured_last():
    problem, space = toy.problem(np.random.default_rng(0), {})
    problem.simulator = Stairs(1800.0, 0.002)
    asked, predict = [], problem.simulator.predict
    problem.simulator.predict = lambda requests: asked.extend(requests) or predict(requests)
    here, there = space.at(np.zeros(len(space))), space.at(np.full(len(space), 0.5))
    problem.correct_mesh((), here)
    known, count = dict(problem.corrections), len(asked)
    assert not problem.correct_mesh_anew((), space.at(np.zeros(len(space))))
    assert len(asked) == count
    assert not problem.correct_mesh_anew((), there)
    assert len(asked) == 2 * count
    for name, change in known.items():
        np.testing.assert_allclose(problem.corrections[name], change, atol=1e-12)


def test_the_size_of_the_mesh_correction_is_that_of_what_is_corrected_now():
    problem, space = toy.problem(np.random.default_rng(0), {}, held=False)
    assert problem.mesh_v == 0.0
    problem.simulator = Stairs(1800.0, 0.002)
    problem.correct_mesh((), space.at(np.zeros(len(space))))
    corrected = np.concatenate([problem.corrections[name] for name in "ab"])
    assert problem.mesh_v == pytest.approx(np.sqrt(np.mean(corrected**2))) != 0.0
    problem.corrections = {name: 2.0 * change for name, change in problem.corrections.items()}
    assert problem.mesh_v == pytest.approx(2.0 * np.sqrt(np.mean(corrected**2)))


def test_candidates_that_a_journal_answers_are_not_counted_as_simulated():
    problem, _ = toy.problem(np.random.default_rng(0), {})
    problem.simulator.simulations, problem.simulator.recalled = 10, 4
    assert problem.simulated == 3.0  # of two records each


def test_a_cheaper_model_is_shifted_to_agree_at_one_candidate():
    problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01})
    assert problem.shifted_low_fidelity((), space.at(np.zeros(len(space)))) is None
    problem.simulator = toy.TwoFidelities()
    here, there = space.at(np.zeros(len(space))), space.at(np.full(len(space), 0.5))
    low = problem.shifted_low_fidelity((), here)
    for one, other in zip(problem.predict((), here), low.predict((), here), strict=True):
        np.testing.assert_allclose(other.voltage, one.voltage)
    assert np.max(np.abs(low.predict((), there)[0].voltage - problem.predict((), there)[0].voltage)) > 1e-3
    assert low.shifted_low_fidelity((), here) is None


def test_a_hold_out_record_that_starts_far_from_the_fitted_ones_gets_its_own_state_of_charge():
    problem, _ = toy.problem(np.random.default_rng(0), {})
    elsewhere = {"resistance factor": 1.2} | {one.measured_record.soc_name: 0.2 for one in problem.observations}
    ((_, error),) = problem.held_out((), elsewhere)
    assert np.sqrt(np.mean(error**2)) < 2 * problem.held_noise_v


def test_a_record_of_few_averages_holds_out_a_part_that_it_has():
    observed = observe(toy.measured_record("a", np.random.default_rng(0), {}), points=150)
    (fitted,) = Problem(toy.ToySimulator(), [subset(observed, np.arange(len(observed)) < 12)]).fitted
    assert 0 < np.count_nonzero(fitted) < 12
    with pytest.raises(BsaError, match="none can be held out"):
        Problem(toy.ToySimulator(), [subset(observed, np.arange(len(observed)) < 6)])
