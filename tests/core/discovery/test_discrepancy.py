from dataclasses import replace

import numpy as np
import pytest
from bsa.core.discovery.discrepancy import Discrepancy, Errors
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import dblquad

NOISE_V = 1e-3
FLAT = 1e-8
"""Inverse variance by which a dense computation says a flat prior."""


def covariance(errors, discrepancy):
    """Noise and discrepancy written out."""
    dense, start = np.diag(errors.sigma**2), 0
    for time in errors.times:
        own = slice(start, start + len(time))
        gaps = np.abs(time[:, None] - time[None, :])
        dense[own, own] += discrepancy.scale_v**2 * np.exp(-gaps / discrepancy.time_s)
        start += len(time)
    return dense


def drawn(seed, discrepancy=None, sizes=(60, 45), parameters=3, slope=1e-3):
    rng = np.random.default_rng(seed)
    times = [np.cumsum(rng.exponential(10.0, size)) for size in sizes]
    count = sum(sizes)
    weights = np.where(np.arange(parameters) == parameters - 1, 0.0, rng.uniform(0.5, 2.0, parameters))
    jacobian = slope * rng.normal(size=(count, parameters))
    made = Errors(
        times, np.zeros(count), np.full(count, NOISE_V), jacobian, rng.normal(size=parameters), weights, parameters
    )
    root = np.linalg.cholesky(covariance(made, discrepancy or Discrepancy()))
    return replace(made, values=root @ rng.normal(size=count))


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.floats(0.0, 0.02), st.floats(1.0, 1e5))
def test_the_evidence_is_that_of_a_dense_computation(seed, scale_v, time_s):
    errors, discrepancy = drawn(seed, slope=0.03), Discrepancy(scale_v, time_s)  # steeper: no step is near its limit
    known = errors.prior_weights > 0
    variances = np.where(known, 1 / np.maximum(errors.prior_weights, 1e-9) ** 2, 1 / FLAT)
    marginal = covariance(errors, discrepancy) + errors.jacobian * variances @ errors.jacobian.T
    # The priors' means are where the coordinates are 0; that of a flat one does not matter.
    residual = errors.values - errors.jacobian @ np.where(known, errors.u, 0.0)
    _, log_det = np.linalg.slogdet(marginal)
    expected = -0.5 * (residual @ np.linalg.solve(marginal, residual) + log_det + len(residual) * np.log(2 * np.pi))
    expected += 0.5 * np.log(2 * np.pi / FLAT)
    assert errors.log_evidence(discrepancy) == pytest.approx(expected, abs=0.1, rel=1e-4)


def test_the_evidence_is_the_integral_over_the_parameters():
    errors, discrepancy = drawn(1, Discrepancy(3e-3, 60.0), (12, 8), 2), Discrepancy(3e-3, 60.0)
    inverse = np.linalg.inv(covariance(errors, discrepancy))
    _, log_det = np.linalg.slogdet(covariance(errors, discrepancy))
    weight = errors.prior_weights[0]

    def logarithm(first, second):
        step = np.array([first, second])
        moved = errors.values + errors.jacobian @ step
        prior = (weight * (errors.u[0] + first)) ** 2 + np.log(2 * np.pi / weight**2)
        return -0.5 * (moved @ inverse @ moved + log_det + len(moved) * np.log(2 * np.pi) + prior)

    top = logarithm(0.0, 0.0)
    found, _ = dblquad(lambda second, first: np.exp(logarithm(first, second) - top), -8, 8, -40, 40)
    assert errors.log_evidence(discrepancy) == pytest.approx(top + np.log(found), abs=1e-3)


@settings(max_examples=20)
@given(st.integers(0, 10_000), st.floats(1e-3, 1e3))
def test_what_tells_two_discrepancies_apart_depends_on_no_unit(seed, factor):
    errors, one, other = drawn(seed), Discrepancy(1e-3, 30.0), Discrepancy(4e-3, 200.0)
    scaled = replace(
        errors, values=factor * errors.values, sigma=factor * errors.sigma, jacobian=factor * errors.jacobian
    )
    told = scaled.log_evidence(replace(one, scale_v=factor * one.scale_v))
    told -= scaled.log_evidence(replace(other, scale_v=factor * other.scale_v))
    assert told == pytest.approx(errors.log_evidence(one) - errors.log_evidence(other), abs=1e-6)
    hours = replace(errors, times=[time / 3600 for time in errors.times])
    later = hours.log_evidence(Discrepancy(one.scale_v, one.time_s / 3600))
    assert later == pytest.approx(errors.log_evidence(one), abs=1e-6)


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_records_have_no_order_and_a_long_pause_parts_one(seed):
    errors, discrepancy = drawn(seed), Discrepancy(3e-3, 50.0)
    first = len(errors.times[0])
    order = np.roll(np.arange(len(errors.values)), -first)
    turned = replace(errors, times=errors.times[::-1], values=errors.values[order], jacobian=errors.jacobian[order])
    assert turned.log_evidence(discrepancy) == pytest.approx(errors.log_evidence(discrepancy), abs=1e-6)
    joined = replace(errors, times=[np.concatenate([errors.times[0], 1e6 + errors.times[1]])])
    assert joined.log_evidence(discrepancy) == pytest.approx(errors.log_evidence(discrepancy), abs=1e-6)


def test_scale_and_correlation_time_are_found():
    found = [drawn(seed, Discrepancy(5e-3, 100.0), (300, 300)).likeliest()[0] for seed in range(5)]
    assert np.median([one.scale_v for one in found]) == pytest.approx(5e-3, rel=0.2)
    assert np.median([one.time_s for one in found]) == pytest.approx(100.0, rel=0.4)


def test_noise_alone_has_no_discrepancy_at_the_stated_rate():
    clear = np.log(100.0)
    told = 0
    for seed in range(40):
        errors = drawn(seed, sizes=(60, 30))
        told += errors.likeliest()[1] - errors.log_evidence(Discrepancy()) > clear
    assert told <= 2


def test_two_samples_of_the_same_time_agree_in_their_discrepancy():
    errors = drawn(2, Discrepancy(5e-3, 100.0))
    twice = [np.concatenate([time[:1], time]) for time in errors.times]
    index = np.concatenate([[0], np.arange(60), [60], np.arange(60, 105)])
    doubled = replace(
        errors,
        times=twice,
        values=errors.values[index],
        sigma=errors.sigma[index],
        jacobian=errors.jacobian[index],
    )
    assert np.isfinite(doubled.log_evidence(Discrepancy(5e-3, 100.0)))
