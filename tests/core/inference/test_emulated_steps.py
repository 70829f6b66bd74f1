from itertools import pairwise

import numpy as np
import pytest
from bsa.core.inference.emulated_steps import EmulatedSteps
from bsa.core.inference.fit_settings import Box, Settings
from bsa.core.inference.least_squares import LeastSquares, solve
from hypothesis import given, settings
from hypothesis import strategies as st

_RNG = np.random.default_rng(5)
_MIXED = np.linalg.qr(_RNG.normal(size=(6, 6)))[0]
_ALONG = _RNG.normal(size=(6, 40))
_NOISE = 0.3 * _RNG.normal(size=40)


def curved(point: np.ndarray) -> np.ndarray:
    """Forty noisy residuals of six parameters whose combinations act a thousand times more and less, and bend."""
    turned = _MIXED @ (np.asarray(point) - 0.55)
    turned = turned + 3.0 * np.roll(turned, 1) ** 2
    return (np.geomspace(1000.0, 0.5, 6) * turned) @ _ALONG + _NOISE


def fitted(emulates: bool, budget: int) -> LeastSquares:
    search = LeastSquares(np.full(6, 0.2), settings=Settings(noise=0.3, tolerance=1 / 34, emulates=emulates))
    solve(search, lambda points: [curved(point) for point in points], budget)
    return search


@pytest.mark.slow
def test_a_narrow_valley_that_bends_takes_fewer_simulations_than_with_jacobians_alone() -> None:
    emulated = fitted(True, budget=60)
    assert emulated.cost < 1.1 * fitted(False, budget=400).cost
    assert emulated.cost < 0.1 * fitted(False, budget=60).cost


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
@settings(max_examples=10)
def test_failures_never_lead_out_of_the_box_nor_uphill_and_end(seed: int, share_failing: float) -> None:
    rng = np.random.default_rng(seed)
    search = LeastSquares(rng.uniform(size=6), settings=Settings(noise=0.3, tolerance=1 / 34, emulates=True))
    search.tell([curved(point) for point in search.ask()])
    costs = [search.cost]
    while (batch := search.ask()) and search.simulations < 120:
        assert np.all((np.array(batch) >= 0.0) & (np.array(batch) <= 1.0))
        search.tell([None if rng.uniform() < share_failing else curved(point) for point in batch])
        costs.append(search.cost)
    assert all(later <= earlier for earlier, later in pairwise(costs))
    assert search.done or search.simulations >= 120


def test_what_fails_is_answered_by_a_jacobian_at_the_best_point() -> None:
    search = LeastSquares(np.full(6, 0.2), settings=Settings(noise=0.3, tolerance=1 / 34, emulates=True))
    while search.stage != "emulated":
        search.tell([curved(point) for point in search.ask()])
    assert len(search.ask()) == 1
    search.tell([None])
    assert len(search.ask()) == 6
    assert search.stage == "jacobian"


def test_behind_the_first_jacobian_its_updates_lead_until_they_fail() -> None:
    search = LeastSquares(np.full(6, 0.2), settings=Settings(noise=0.3, tolerance=1 / 34, emulates=True))
    solve(search, lambda points: [curved(point) for point in points], budget=1 + 6 + 3)
    assert search.stage == "step"
    while search.stage == "step":
        search.tell([curved(point) for point in search.ask()])
    assert search.stage == "emulated"
    while search.stage != "jacobian":
        search.tell([curved(point) for point in search.ask()])
    for _ in range(2):  # The second Jacobian and a step on it.
        search.tell([curved(point) for point in search.ask()])
    while search.stage == "step":
        failed = search.cost
        search.tell([curved(point) for point in search.ask()])
        assert search.cost == failed or search.stage != "step"


@pytest.mark.slow
def test_whether_a_jacobian_is_wanted_is_known_before_it_is_asked_for() -> None:
    search = LeastSquares(np.full(6, 0.2), settings=Settings(noise=0.3, tolerance=1 / 34, emulates=True))
    while (stage := search.stage) != "done" and search.simulations < 200:
        batch = search.ask()
        assert search.stage == stage
        assert (len(batch) > 1) == (stage == "jacobian")
        search.tell([curved(point) for point in batch])


def test_what_does_not_suffice_for_a_jacobian_goes_to_an_emulators_steps_shorter_ones_behind_a_failure() -> None:
    search = LeastSquares(np.full(6, 0.2), settings=Settings(noise=0.3, tolerance=1 / 34, emulates=True))
    while search.stage != "emulated":
        search.tell([curved(point) for point in search.ask()])
    here = search.point
    (failed,) = search.ask()
    search.tell([None])
    assert search.stage == "jacobian"
    (shorter,) = search.ask(limit=6)
    assert search.stage == "emulated"
    assert np.max(np.abs(shorter - here)) <= 0.5 * np.max(np.abs(failed - here)) + 1e-12
    before = search.cost
    search.tell([curved(shorter)])
    for left in range(5, 0, -1):
        (point,) = search.ask(left)
        search.tell([curved(point)])
    assert search.cost < before


def test_only_free_coordinates_move_and_a_prior_is_kept() -> None:
    box = Box(np.full(2, -4.0), np.full(2, 4.0), np.array([3.0, 0.0]))
    steps = EmulatedSteps(box, np.array([True, False]), noise=1.0)
    for x in np.linspace(-2.0, 2.0, 9):
        steps.remember(np.array([x, 0.0]), np.array([4.0 * (x - 1.0), 0.1]))
    steps.remember(np.array([0.1, 0.0]), None)
    step, gain = steps.step(np.array([-1.0, 0.0]), radius=9.0)
    # Of 16 (x - 1)^2 + 9 x^2 the least.
    assert step == pytest.approx([1.0 + 16.0 / 25.0, 0.0], abs=1e-3)
    assert gain == pytest.approx(64.0 + 9.0 - (16.0 * 0.36**2 + 9.0 * 0.64**2), rel=0.1)
    assert steps.derivatives(np.array([0.5, 0.0])) == pytest.approx(np.array([[4.0, 0.0], [0.0, 0.0]]), abs=0.05)


def test_the_noise_sets_the_unit_of_residuals_and_of_a_gain() -> None:
    found = []
    for unit in (1.0, 1e3):
        steps = EmulatedSteps(Box.unit(6), np.ones(6, dtype=bool), noise=0.3 * unit)
        for point in np.random.default_rng(2).uniform(size=(30, 6)):
            steps.remember(point, unit * curved(point))
        step, gain = steps.step(np.full(6, 0.5), radius=1.0)
        found.append(np.append(step, gain / unit**2))
    assert found[0] == pytest.approx(found[1], rel=1e-3, abs=1e-4)


def test_what_was_simulated_before_is_learnt_from() -> None:
    points = np.random.default_rng(3).uniform(size=(60, 6))
    known = [(point, curved(point)) for point in points]
    how = Settings(noise=0.3, tolerance=1 / 34, emulates=True)
    start, residual = min(known, key=lambda pair: float(pair[1] @ pair[1]))
    knowing = LeastSquares(start, residual, how, jacobian=np.zeros((40, 6)), known=known)
    solve(knowing, lambda batch: [curved(point) for point in batch], budget=12)
    assert knowing.cost < 0.2 * float(residual @ residual)
