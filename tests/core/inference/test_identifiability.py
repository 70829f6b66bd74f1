import json
from dataclasses import asdict

import numpy as np
import pytest
from bsa.core.inference.identifiability import (
    Identifiability,
    effective_noise,
    identify,
    neighbour_correlation,
    not_narrower,
    residual_noise,
    unsettled,
    with_sample,
)
from bsa.core.inference.least_squares import LeastSquares, solve
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from scipy.optimize import lsq_linear
from scipy.signal import lfilter

SPACE = ParameterSpace(
    (
        Parameter("radius [m]", 5e-6, 1e-6, 2e-5, "log"),
        Parameter("porosity", 0.3, 0.1, 0.6),
        Parameter("exponent", 1.5, 1.0, 4.0),
    )
)


def identified(
    matrix: np.ndarray, residual: np.ndarray, at: Candidate = SPACE.initial, floor: float = 0.0
) -> Identifiability:
    return identify(matrix, residual, SPACE, at, residual_noise(residual, len(SPACE), floor))


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(5)
    matrix = rng.normal(size=(40, 3)) * [30.0, 8.0, 15.0]
    truth = np.array([0.45, 0.5, 0.55])
    hits = np.zeros(3)
    repeats = 400
    for _ in range(repeats):
        noisy = matrix @ truth + rng.normal(size=40)
        estimate = np.linalg.lstsq(matrix, noisy, rcond=None)[0]
        found = identified(matrix, matrix @ estimate - noisy, SPACE.from_unit(estimate))
        wanted = SPACE.from_unit(truth)
        hits += [found.intervals[n].lower <= wanted[n] <= found.intervals[n].upper for n in SPACE.names]
    assert hits / repeats == pytest.approx(np.full(3, 0.95), abs=0.035)


@pytest.mark.parametrize(("correlation", "least"), [(0.0, 0.93), (0.8, 0.90), (0.95, 0.80)])
def test_intervals_hold_where_neighbouring_errors_are_alike(correlation: float, least: float) -> None:
    """With the correlation that residuals show they hold the truth in 89 and 75 % at 0.8 and 0.95."""
    rng = np.random.default_rng(5)
    place = (np.arange(300) + 0.5) / 300
    jacobian = np.column_stack([np.cos(np.pi * number * place) for number in range(4)])
    known = np.linalg.inv(jacobian.T @ jacobian)
    held = []
    for _ in range(300):
        steps = np.sqrt(1.0 - correlation**2) * rng.normal(size=700)
        errors = lfilter([1.0], [1.0, -correlation], steps)[400:]
        found = known @ jacobian.T @ errors
        noise = effective_noise(errors - jacobian @ found, 4, 0.0)
        held += list(np.abs(found) < 1.96 * noise * np.sqrt(np.diag(known)))
    assert least < np.mean(held) < 0.97


def test_a_product_is_one_combination_and_its_factors_a_correlated_group() -> None:
    # Only the sum of the first two coordinates shows.
    matrix = np.random.default_rng(1).normal(size=(50, 2)) @ np.array([[100.0, 100.0, 0.0], [0.0, 0.0, 80.0]])
    found = identified(matrix, np.full(50, 0.5))
    assert found.correlated == (("radius [m]", "porosity"),)
    assert found.intervals["exponent"].verdict == "fixed"
    assert found.open == ("radius [m]", "porosity")
    assert found.combinations[-1].verdict == "open"
    weights = found.combinations[-1].weights
    assert weights["radius [m]"] == pytest.approx(-weights["porosity"])
    interval = found.intervals["radius [m]"]
    assert 1e-6 <= interval.lower < interval.value < interval.upper <= 2e-5


def test_a_parameter_that_does_nothing_is_known_only_by_its_bounds() -> None:
    matrix = np.random.default_rng(2).normal(size=(30, 3)) * [50.0, 50.0, 0.0]
    found = identified(matrix, np.ones(30))
    assert (found.intervals["exponent"].lower, found.intervals["exponent"].upper) == (1.0, pytest.approx(3.2, abs=0.3))
    assert found.combinations[-1].singular_value == pytest.approx(0.0, abs=1e-12)


def test_fewer_residuals_than_parameters_are_no_error() -> None:
    found = identified(np.array([[100.0, 0.0, 0.0]]), np.array([0.1]))
    assert len(found.combinations) == 3
    assert found.open == ("porosity", "exponent")


def test_the_floor_keeps_a_noiseless_record_from_claiming_perfection() -> None:
    matrix = np.random.default_rng(3).normal(size=(30, 3))
    sharp = identified(matrix, np.zeros(30))
    honest = identified(matrix, np.zeros(30), floor=0.5)
    assert sharp.intervals["porosity"].share_of_range == pytest.approx(0.0)
    assert honest.intervals["porosity"].share_of_range > 0.05
    assert residual_noise(np.zeros(4), 1, floor=0.2) == 0.2


def at_a_bound(value: float, draws: np.ndarray, holds_fit: bool) -> Identifiability:
    only = ParameterSpace((Parameter("a", 1.0, 1.0, 3.0),))
    found = identify(np.ones((9, 1)), np.zeros(9), only, {"a": value}, 1.0)
    return with_sample(found, draws[:, None], only, holds_fit)


def test_a_fit_at_a_bound_is_inside_an_interval_of_the_same_probability() -> None:
    draws = np.abs(np.random.default_rng(0).normal(0.0, 0.1, 4000))
    found = at_a_bound(1.0, draws, True)
    one = found.intervals["a"]
    assert found.apart == ()
    assert one.lower == 1.0
    assert np.mean(1.0 + 2.0 * draws <= one.upper) == pytest.approx(0.95, abs=1e-3)
    # An interval with equal tails is no narrower, and leaves the likeliest value out.
    tails = at_a_bound(1.0, draws, False)
    assert tails.apart == ("a",)
    assert tails.intervals["a"].share_of_range > one.share_of_range
    # About a fit amid the draws both are the same.
    assert at_a_bound(1.2, draws, True).intervals == at_a_bound(1.2, draws, False).intervals


def test_an_interval_is_not_stretched_to_a_fit_that_is_less_likely_than_the_draws() -> None:
    draws = np.random.default_rng(0).normal(0.5, 0.01, 4000)
    found = at_a_bound(2.5, draws, False)
    assert found.apart == ("a",)
    assert found.intervals["a"].share_of_range < 0.021


def test_intervals_of_two_analyses_are_taken_together() -> None:
    matrix = np.random.default_rng(3).normal(size=(30, 3)) * 10.0
    sharp, wide = (identify(matrix, np.zeros(30), SPACE, SPACE.initial, noise) for noise in (0.1, 1.0))
    both = not_narrower(sharp, wide, SPACE).intervals
    for name, interval in wide.intervals.items():
        assert both[name].lower == pytest.approx(interval.lower)
        assert both[name].upper == pytest.approx(interval.upper)
        assert both[name].verdict == interval.verdict
    assert not_narrower(wide, sharp, SPACE).intervals["radius [m]"].upper == pytest.approx(both["radius [m]"].upper)


def test_the_report_is_json() -> None:
    matrix = np.random.default_rng(4).normal(size=(30, 3))
    found = identified(matrix, np.ones(30))
    again = json.loads(json.dumps(asdict(found)))
    assert again["intervals"]["porosity"]["value"] == 0.3
    assert len(again["combinations"]) == 3


@pytest.mark.parametrize(("count", "parameters"), [(34, 9), (40, 15), (34, 20), (400, 20)])
def test_the_noise_does_not_jump_where_a_correlation_begins(count: int, parameters: int) -> None:
    found = []
    for correlation in (-1e-6, 1e-6):
        residual = np.tile([1.0, 1.0, -1.0, -1.0], count)[:count]
        residual[0] = 0.0  # The products of neighbours cancel but for the last, which sets their correlation.
        power = residual[1:-1] @ residual[1:-1]
        rest = float(residual[:-2] @ residual[1:-1])
        residual[-1] = (correlation * power - rest) / residual[-2]
        found.append(effective_noise(residual, parameters, 0.0) / np.sqrt(np.sum(residual**2)))
    assert found[0] == pytest.approx(found[1], rel=1e-2)


def test_few_residuals_do_not_blow_up_the_noise() -> None:
    """The bias of a correlation is known to first order in parameters over residuals."""
    slow = np.cos(2.0 * np.pi * np.arange(34) / 4.5)
    assert 0.1 < neighbour_correlation(slow) < 0.2
    assert effective_noise(slow, 20, 0.0) < 3.0 * residual_noise(slow, 20)


def test_it_judges_a_fit() -> None:
    def function(points: list[np.ndarray]) -> list[np.ndarray]:
        times = np.linspace(0, 1, 30)
        return [
            100 * (np.log(c["radius [m]"] / 4e-6) * times + (c["porosity"] - 0.4) * times**2 + 0.0 * c["exponent"])
            for c in map(SPACE.from_unit, points)
        ]

    fit = LeastSquares(SPACE.to_unit(SPACE.initial))
    solve(fit, function, budget=30)
    assert fit.jacobian is not None
    assert fit.residual is not None
    found = identified(fit.jacobian, fit.residual, SPACE.from_unit(fit.point), 1.0)
    assert found.intervals["radius [m]"].lower < 4e-6 < found.intervals["radius [m]"].upper
    assert found.intervals["porosity"].lower < 0.4 < found.intervals["porosity"].upper
    assert found.open == ("exponent",)


def test_noise_is_no_structure_and_a_wrong_curve_is() -> None:
    from bsa.core.inference.identifiability import is_structured, neighbour_correlation

    noise = 10.0 * np.random.default_rng(1).normal(size=400)
    curve = 10.0 * np.sin(np.linspace(0, 6, 400))
    assert abs(neighbour_correlation(noise)) < 0.2
    assert neighbour_correlation(curve) > 0.95
    assert not is_structured(noise)
    assert is_structured(curve)
    assert not is_structured(0.1 * curve)  # below what an instrument resolves


def test_a_fit_that_has_come_to_its_optimum_at_a_bound_has_settled() -> None:
    matrix = np.random.default_rng(4).normal(size=(40, 2)) * 50.0
    beyond, names = np.array([-0.2, 0.5]), ("a", "b")
    best = lsq_linear(matrix, matrix @ beyond, bounds=(0.0, 1.0), method="bvls").x
    assert best[0] == pytest.approx(0.0, abs=1e-9)
    assert unsettled(matrix, matrix @ (best - beyond), 1.0, names, best) == ()
    short = best + np.array([0.0, 0.1])
    assert "b" in unsettled(matrix, matrix @ (short - beyond), 1.0, names, short)
    inside = np.array([0.3, 0.5])
    assert unsettled(matrix, matrix @ (inside - [0.2, 0.5]), 1.0, names, inside) == ("a",)
