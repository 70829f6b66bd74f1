import numpy as np
import pytest
from bsa.core.contracts.requests import MeasuredRecord
from bsa.core.discovery.score import overlap, score_effect
from bsa.core.inference.adequacy import FALSE_ALARM, judge
from bsa.core.inference.observations import freedom_of_deviations, observe, voltage_noise
from bsa.core.inference.refit import Refit, refit, slopes_at
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.trajectory import Step, StepKind, Trajectory
from hypothesis import given, settings
from hypothesis import strategies as st


def each(residual):
    """Residuals of one candidate as a function of several."""
    return lambda candidates: [residual(candidate) for candidate in candidates]


def space(count):
    return ParameterSpace(tuple(Parameter(f"p{k}", 0.0, -50.0, 50.0, deviation=1.0) for k in range(count)))


def test_intervals_hold_where_an_error_is_the_same_over_a_whole_step():
    rng = np.random.default_rng(8)
    slope, step = np.repeat([0.0, 1.0, 2.0], 40), np.repeat(np.arange(3), 40)
    jacobian = np.column_stack([slope, np.ones(120)])
    floors = 0.8 * (step[:, None] == np.arange(3))
    held = {"white": 0, "systematic": 0}
    for _ in range(400):
        residual = rng.normal(size=120) + floors @ rng.normal(size=3)
        u = -np.linalg.lstsq(jacobian, residual, rcond=None)[0]
        fit = Refit(space(2), u, residual + jacobian @ u, jacobian, True)
        for name, systematic in (("white", None), ("systematic", floors)):
            held[name] += abs(u[0]) < 1.96 * np.sqrt(fit.covariance(1.0, systematic)[0, 0])
    assert held["white"] < 0.5 * 400
    assert 0.9 * 400 < held["systematic"] < 0.99 * 400


@pytest.mark.slow
def test_false_alarms_stay_at_the_stated_rate():
    rng = np.random.default_rng(5)
    alarms = 0
    for _ in range(600):
        residual = rng.normal(size=200)
        group = np.repeat(np.arange(5), 40)
        alarms += not judge(residual, group).adequate
    assert alarms / 600 < 2.5 * FALSE_ALARM


def discharge(time, voltage):
    return Trajectory(time, np.ones_like(time), voltage, None, (Step(StepKind.CC_DISCHARGE, 0, len(time)),))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "noise_v", "rounding_v", "tails"),
    [(100, 3e-3, 0.0, None), (300, 2e-3, 3e-3, None), (2000, 1e-4, 3e-3, None), (300, 1e-3, 0.0, 3)],
    ids=["few samples", "rounded", "rounded with little noise", "outliers"],
)
def test_noise_that_a_record_tells_itself_raises_no_false_alarms(count, noise_v, rounding_v, tails):
    rng = np.random.default_rng(11)
    time = 5.0 * np.arange(count)
    alarms = 0
    for _ in range(100):
        noise = rng.normal(size=count) if tails is None else rng.standard_t(tails, count) / np.sqrt(tails / (tails - 2))
        true = 4.1 - 0.3 * time / time[-1] - 0.05 * np.exp(-time / 60) + rng.uniform(-1e-3, 1e-3)
        seen = true + noise_v * noise
        if rounding_v:
            seen = rounding_v * np.round(seen / rounding_v)
        found = observe(MeasuredRecord("r", discharge(time, seen)))
        residual = (found.voltage - np.interp(found.time, time, true)) / found.sigma
        alarms += not judge(residual, found.step, None, freedom_of_deviations([found], [found.sigma])).adequate
    assert alarms <= 3


def test_a_reading_that_stands_alone_is_no_discrepancy_and_neighbours_or_the_end_of_a_step_are():
    step = np.zeros(300, dtype=int)
    noise = np.random.default_rng(12).normal(size=300)
    for places, adequate in (([100], True), ([100, 200], True), ([100, 101, 102, 103], False), ([299], False)):
        residual = noise.copy()
        residual[places] += 15.0
        assert judge(residual, step).adequate == adequate, places


def test_deviations_that_are_mostly_floor_are_known():
    time = 5.0 * np.arange(400)
    rng = np.random.default_rng(13)
    noisy, quiet = (observe(MeasuredRecord("r", discharge(time, 4.0 + rng.normal(0.0, s, 400)))) for s in (3e-3, 5e-5))
    assert freedom_of_deviations([noisy], [noisy.sigma]) == pytest.approx(100, rel=0.1)
    assert freedom_of_deviations([quiet], [quiet.sigma]) > 1e4
    both = freedom_of_deviations([noisy, noisy], [noisy.sigma, noisy.sigma])
    assert both == pytest.approx(200, rel=0.1)


@pytest.mark.slow
def test_parameters_that_priors_hold_raise_no_false_alarms():
    rng = np.random.default_rng(9)
    place = np.linspace(0, np.pi, 200)
    jacobian = 0.03 * np.column_stack([np.cos(number * place) for number in range(10)])
    held = ParameterSpace(tuple(Parameter(f"p{k}", 0.0, -50.0, 50.0, deviation=1.0, prior=True) for k in range(10)))
    alarms = 0
    for _ in range(1500):
        seen = jacobian @ rng.normal(size=10) + rng.normal(size=200)
        u = np.linalg.solve(jacobian.T @ jacobian + np.eye(10), jacobian.T @ seen)
        fit = Refit(held, u, seen - jacobian @ u, -jacobian, True)
        alarms += not judge(fit.residual, np.zeros(200, dtype=int), fit.taken).adequate
    assert 0.5 < np.sum(fit.taken**2) < 2.0
    assert alarms / 1500 < 2.0 * FALSE_ALARM


@pytest.mark.slow
@pytest.mark.parametrize(("count", "parameters"), [(60, 10), (60, 14), (100, 24), (400, 12)])
@pytest.mark.parametrize("smooth", [True, False])
def test_what_a_fit_takes_from_noise_raises_no_false_alarms(count, parameters, smooth):
    rng = np.random.default_rng(3)
    responses = (
        np.polynomial.legendre.legvander(np.linspace(-1, 1, count), parameters - 1)
        if smooth
        else rng.normal(size=(count, parameters))
    )
    step, alarms = np.repeat(np.arange(2), count // 2), 0
    for _ in range(400):
        seen = rng.normal(size=count)
        u = np.linalg.lstsq(responses, seen, rcond=None)[0]
        fit = Refit(space(parameters), u, seen - responses @ u, -responses, True)
        alarms += not judge(fit.residual, step, fit.taken).adequate
    assert alarms / 400 < 2.5 * FALSE_ALARM


def test_a_fit_with_as_many_parameters_as_residuals_leaves_no_evidence():
    found = judge(np.full(4, 9.0), np.zeros(4, dtype=int), np.eye(4))
    assert (found.p_size, found.p_structure) == (1.0, 1.0)


def test_agreement_of_neighbours_is_seen_where_size_is_not():
    rng = np.random.default_rng(6)
    residual = 0.75 * rng.normal(size=400) + 0.7 * np.sign(np.sin(np.arange(400) / 12.7))
    found = judge(residual, np.zeros(400, dtype=int))
    assert found.p_size > 1e-3
    assert not found.adequate


def far_reaching(fit, mark, bounds):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bsa.core.discovery.score._REACH", 1e3)
        return score_effect(fit, mark, bounds)


@settings(max_examples=60)
@given(st.integers(0, 10_000), st.floats(0.3, 5.0), st.sampled_from([-1.0, 1.0]))
def test_the_score_recovers_size_and_sign_behind_parameters(seed, size, sign):
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(120, 4))
    mark = rng.normal(size=120) + jacobian @ rng.normal(size=4)
    # residual = data - model falls as the strength rises by what the mark says
    residual = -sign * size * mark - jacobian @ rng.normal(size=4)
    fit = Refit(space(4), np.zeros(4), residual, jacobian, True)
    score = far_reaching(fit, mark, (0.0, 100.0))
    assert np.sign(score.z) == sign
    if sign > 0:
        assert score.amplitude == pytest.approx(size, rel=1e-3)
        assert score.gain > 0
    else:
        assert score.amplitude == pytest.approx(0.0, abs=1e-6)
        assert score.gain == pytest.approx(0.0, abs=1e-3)


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_what_parameters_imitate_has_no_score(seed):
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(80, 3))
    mark = jacobian @ rng.normal(size=3)
    fit = Refit(space(3), np.zeros(3), rng.normal(size=80), jacobian, True)
    score = far_reaching(fit, mark, (0.0, 10.0))
    assert abs(score.z) < 1e-2 or score.gain < 1e-3


def test_the_overlap_of_two_sensitivities_is_that_behind_the_parameters():
    rng = np.random.default_rng(3)
    jacobian, one, other = rng.normal(size=(200, 3)), *rng.normal(size=(2, 200))
    fit = Refit(space(3), np.zeros(3), rng.normal(size=200), jacobian, True)
    assert overlap(fit, one, -2.0 * one + 50.0 * jacobian[:, 0]) == pytest.approx(1.0, abs=1e-2)
    assert overlap(fit, one, other) < 0.1
    assert overlap(fit, one, jacobian[:, 0]) < 0.1
    assert overlap(fit, one, np.zeros(200)) == 0.0


def test_a_fit_converges_inside_bounds():
    rng = np.random.default_rng(1)
    matrix = rng.normal(size=(60, 3))
    target = matrix @ np.array([1.0, -2.0, 80.0])

    def residual(candidate):
        return target - matrix @ np.array([candidate[f"p{k}"] for k in range(3)])

    fit = refit(each(residual), space(3), np.zeros(3), tolerance=1e-8)
    assert fit is not None
    assert fit.converged
    assert fit.candidate["p2"] == pytest.approx(50.0)
    assert np.all(np.abs(fit.u) <= 50.0 + 1e-9)


def test_a_fit_survives_candidates_that_fail():
    def residual(candidate):
        x = candidate["p0"]
        return None if x > 2.5 else np.array([x - 2.0, 0.1 * (x - 2.0)])

    fit = refit(each(residual), space(1), np.array([-4.0]))
    assert fit is not None
    assert fit.candidate["p0"] == pytest.approx(2.0, abs=2e-2)
    assert refit(each(lambda candidate: None), space(1), np.zeros(1)) is None


@settings(max_examples=20)
@given(st.floats(2e-4, 3e-3), st.integers(0, 1000))
def test_noise_is_read_off_a_curve(noise, seed):
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 3000.0, 5.0)
    voltage = 4.1 - 0.3 * time / 3000 - 0.05 * np.exp(-time / 60) + rng.normal(0, noise, len(time))
    record = Trajectory(time, np.ones_like(time), voltage, None, (Step(StepKind.CC_DISCHARGE, 0, len(time)),))
    assert voltage_noise(record) == pytest.approx(noise, rel=0.25)


def test_a_slope_is_taken_over_what_the_data_can_see():
    # A knee: over the usual step of 0.1 the residual doubles many times, and the difference is far off the slope.
    def residual(candidate):
        return 100 * np.exp(30 * candidate["p0"]) * np.ones(50) + candidate["p1"]

    both = ParameterSpace(tuple(Parameter(f"p{k}", 0.0, -5.0, 5.0, deviation=1.0, prior=True) for k in range(2)))
    asked = 0

    def counted(candidates):
        nonlocal asked
        asked += len(candidates)
        return each(residual)(candidates)

    here = residual({"p0": 0.0, "p1": 0.0})
    jacobian = slopes_at(counted, Refit(both, np.zeros(2), here, np.zeros((50, 2)), False))
    assert jacobian[0, 0] == pytest.approx(3000, rel=0.05)
    assert jacobian[0, 1] == pytest.approx(1.0)
    first, asked = asked, 0
    again = slopes_at(counted, Refit(both, np.zeros(2), here, jacobian, False))
    assert asked == 2 < first
    assert again[0, 0] == pytest.approx(3000, rel=0.05)


def test_a_fit_without_a_fresh_jacobian_promises_anything():
    def residual(candidate):
        return np.array([candidate["p0"] - 1.0, 10 * (candidate["p1"] - candidate["p0"] ** 2)])

    short = refit(each(residual), space(2), np.array([-1.0, 1.0]), np.eye(2), budget=2)
    assert short is not None
    assert short.promised == np.inf
    assert not short.converged
    whole = refit(each(residual), space(2), np.array([-1.0, 1.0]), budget=200)
    assert whole is not None
    assert whole.promised < 1.0
    assert whole.converged
