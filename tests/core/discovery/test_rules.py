import math
from dataclasses import replace

import numpy as np
import pytest
from bsa.core.discovery.explanation import TEMPERATURE_DEVIATION_K, Estimate, Explanation
from bsa.core.discovery.findings import Gap
from bsa.core.discovery.rules import RULES, bic_difference, closed
from bsa.core.effect import Effect, EffectParameter
from bsa.core.inference.adequacy import Adequacy
from bsa.core.inference.refit import Refit
from bsa.core.parameters import Parameter, ParameterSpace


def explanation(name, kelvin, rmse=1.0):
    effect = Effect(name, name, "", (EffectParameter("size", "", 0.0, 0.0, 10.0, 1.0),), "", "")
    fit = Refit(ParameterSpace(effect.searched), np.zeros(1), np.full(80, rmse), np.ones((80, 1)), True)
    errors = rmse * np.where(np.arange(80) % 2, 1e-3, -1e-3)
    sigma = np.full(80, 1e-3)
    found = Explanation((effect,), fit, Adequacy(0.5, 0.5, 1.0), 1e-3, 1e-3, errors, sigma, kelvin)
    found.estimates = {effect.key: (Estimate("size", "", 1.0, (0.9, 1.1), 0.0, False),)}
    return found


def test_a_temperature_that_no_fit_was_shown_tells_equals_apart():
    warm, blind, unknown = explanation("heat", 2.0), explanation("cold", 15.0), explanation("cold", None)
    assert RULES.rivals(warm, [blind]) == []
    assert RULES.rivals(warm, [unknown]) == [unknown]
    assert RULES.rivals(warm, [explanation("other", 2.5)]) != []
    assert RULES.rivals(blind, [warm]) == [warm]


def test_a_temperature_counts_as_one_observation():
    warm, blind, unknown = explanation("heat", 2.0), explanation("cold", 10.0), explanation("cold", None)
    assert bic_difference(blind, warm) == pytest.approx((10.0**2 - 2.0**2) / TEMPERATURE_DEVIATION_K**2)
    assert bic_difference(warm, blind) == pytest.approx(-bic_difference(blind, warm))
    assert bic_difference(unknown, explanation("heat", None)) == pytest.approx(0.0)


def test_a_gap_that_bent_parameters_hide_shows_in_the_temperature():
    base = explanation("base", 15.0, rmse=5.0)
    expected = ParameterSpace((Parameter("p", 0.0, -50.0, 50.0, deviation=1.0, prior=True),))
    base.fit = replace(base.fit, space=expected, u=np.array([9.0]))
    base.held_rmse_v = 2e-3
    base.rmse_v = 1.02e-3
    blind, warm = explanation("cold", 15.0), explanation("heat", 2.0)
    for found in (blind, warm):
        found.adequacy = Adequacy(0.0, 0.0, 1.0)
    assert "of the squared misfit only" in RULES.objection_to(blind, Gap(base, base, 1e-4, 1e-4))
    assert RULES.objection_to(warm, Gap(base, base, 1e-4, 1e-4)) == ""
    warm.held_rmse_v = 1.05 * base.held_rmse_v
    assert RULES.objection_to(warm, Gap(base, base, 1e-4, 1e-4)) == ""
    warm.held_rmse_v = 1.2 * base.held_rmse_v
    assert "data not fitted" in RULES.objection_to(warm, Gap(base, base, 1e-4, 1e-4))


@pytest.mark.parametrize(
    ("base_rmse", "held", "objected"), [(3.0, 1.05, False), (3.0, 1.2, True), (1.2, 1.05, True), (1.2, 0.95, False)]
)
def test_data_that_both_mispredict_alike_are_no_objection_to_who_is_far_ahead_and_leaves_noise(
    base_rmse, held, objected
):
    base, found = explanation("base", None, rmse=base_rmse), explanation("cause", None)
    base.held_rmse_v, found.held_rmse_v = 2e-3, held * 2e-3
    assert ("data not fitted" in RULES.objection_to(found, Gap(base, base, 1e-4, 1e-4))) is objected


@pytest.mark.parametrize(("without", "excluded"), [(10.0, True), (3.0, False), (None, False)])
def test_a_null_that_the_voltage_does_not_exclude_the_temperature_may(without, excluded):
    found = explanation("heat", 2.0)
    found.estimates = {"heat": (Estimate("size", "", 1.0, (-0.5, 2.5), 0.0, False),)}
    found.temperature_without_k = {} if without is None else {"heat": without}
    assert found.excludes_null() is excluded


@pytest.mark.parametrize(
    ("fitted_mv", "held_mv", "base_held_mv", "words"),
    [
        (5.0, 3.0, 10.0, ""),
        (5.0, 6.0, 10.0, "in data not fitted only"),
        (5.5, 3.0, 10.0, "explains 70% of the squared misfit only, and leaves 5.5 times the noise"),
        (8.0, 3.0, 10.0, "of the squared misfit only"),
        (6.0, 1.0, 1.05, "of the squared misfit only"),
        (3.0, 1.0, 1.05, ""),
    ],
)
def test_data_that_was_not_fitted_decides_what_is_closed_where_it_shows_the_gap(
    fitted_mv, held_mv, base_held_mv, words
):
    base, found = explanation("base", None, rmse=10.0), explanation("effect", None, rmse=2.0)
    found.adequacy = Adequacy(0.0, 0.0, 1.0)
    base.rmse_v, base.held_rmse_v = 10e-3, 1e-3 * base_held_mv
    found.rmse_v, found.held_rmse_v = 1e-3 * fitted_mv, 1e-3 * held_mv
    reason = RULES.objection_to(found, Gap(base, base, 1e-3, 1e-3))
    assert words in reason
    assert bool(words) == bool(reason)


@pytest.mark.parametrize(("known_mv", "share"), [(0.0, 0.64), (4.0, 0.76), (11.0, 0.64)])
def test_an_effect_is_not_asked_to_explain_what_the_base_model_left_before(known_mv, share):
    """A measured cell lacks something everywhere: an effect could close three quarters of its gap only by far more."""
    base, found = explanation("base", None, rmse=10.0), explanation("effect", None, rmse=2.0)
    found.adequacy = Adequacy(0.0, 0.0, 1.0)
    base.rmse_v = base.held_rmse_v = 10e-3
    found.rmse_v = found.held_rmse_v = 6e-3
    gap = Gap(base, base, 1e-4, 1e-4, 1e-3 * known_mv)
    assert closed(10e-3, 6e-3, gap.floor_v) == pytest.approx(share, abs=5e-3)
    assert gap.held_floor_v == gap.floor_v
    assert bool(RULES.objection_to(found, gap)) is (share < 0.75)


def test_a_name_beside_which_more_than_noise_is_left_says_how_much():
    base = explanation("base", None, rmse=10.0)
    base.rmse_v = base.held_rmse_v = 10e-3
    partial, whole = explanation("effect", None, rmse=2.0), explanation("effect", None)
    partial.adequacy, partial.rmse_v = Adequacy(0.0, 0.0, 1.0), 2e-3
    left = "leaves 4.0 times the noise: something else may be missing too, and the values found may compensate for it"
    small = explanation("effect", None, rmse=2.0)
    small.adequacy, small.rmse_v = partial.adequacy, 0.4e-3
    not_random = (
        f"leaves errors of the size of the noise that are not random{left.removeprefix('leaves 4.0 times the noise')}"
    )
    for found, said in ((partial, left), (small, not_random), (whole, "in BIC")):
        assert RULES.decide(Gap(base, base, 0.5e-3, 0.5e-3), [found]).reason.endswith(said)


@pytest.mark.parametrize("found_mv", [9.0, 11.0])
def test_what_comes_no_nearer_to_the_records_is_no_partial_explanation(found_mv):
    base, found = explanation("base", None, rmse=10.0), explanation("effect", None, rmse=2.0)
    base.adequacy = found.adequacy = Adequacy(0.0, 0.0, 1.0)
    base.rmse_v = base.held_rmse_v = 10e-3
    found.rmse_v = 1e-3 * found_mv
    decided = RULES.decide(Gap(base, base, 1e-4, 1e-4), [found])
    assert decided.verdict == "unexplained"
    assert decided.best is (found if found_mv < 10.0 else base)


@pytest.mark.parametrize(("base_rmse", "named"), [(1.2, False), (3.0, True)], ids=["ahead", "far ahead"])
def test_an_effect_beside_which_the_error_grows_is_named_only_far_ahead(base_rmse, named):
    """Between two cycles of a healthy cell an offset was named with which the error rose from 3.2 to 6.7 mV."""
    base, found = explanation("base", None, rmse=base_rmse), explanation("cause", None)
    base.rmse_v, found.rmse_v = 3.2e-3, 6.7e-3
    base.held_rmse_v, found.held_rmse_v = 2e-3, 1e-3
    gap = Gap(base, base, 1e-4, 1e-4)
    assert (RULES.objection_to(found, gap) == "") is named
    found.adequacy = Adequacy(0.0, 0.0, 1.0)
    assert RULES.objection_to(found, gap) == "comes no nearer to the records than the base model"


def test_what_comes_nearer_stands_before_what_is_likelier_and_farther():
    base, likelier, nearer = (
        explanation(name, None, rmse=size) for name, size in (("b", 10.0), ("l", 2.0), ("n", 3.0))
    )
    base.adequacy = likelier.adequacy = nearer.adequacy = Adequacy(0.0, 0.0, 1.0)
    base.rmse_v, likelier.rmse_v, nearer.rmse_v = 10e-3, 11e-3, 9e-3
    decided = RULES.decide(Gap(base, base, 1e-4, 1e-4), [likelier, nearer])
    assert decided.best is nearer
    assert decided.reason.startswith("n: explains 19% of the squared misfit only")


@pytest.mark.parametrize("adequate", [True, False])
def test_two_effects_are_named_only_where_they_leave_no_more_than_noise(adequate):
    base = explanation("base", None, rmse=50.0)
    base.rmse_v = base.held_rmse_v = 50e-3
    found = explanation("one", None, rmse=2.0)
    found.effects += explanation("other", None).effects
    found.estimates |= explanation("other", None).estimates
    found.adequacy, found.rmse_v = Adequacy(*(0.5 * adequate,) * 2, 1.0), 2e-3
    reason = RULES.objection_to(found, Gap(base, base, 1e-3, 1e-3))
    assert reason == "" if adequate else reason.startswith("leaves 2.0 times the noise, and two effects are named only")


def test_who_predicts_data_not_fitted_clearly_worse_is_no_rival():
    best, other = explanation("one", None), explanation("other", None)
    assert RULES.rivals(best, [other]) == [other]
    other.held_rmse_v = 1.2 * best.held_rmse_v
    assert RULES.rivals(best, [other]) == []


@pytest.mark.parametrize(
    ("left", "variance_inflation", "promised", "settled"),
    [
        (1.0, 1.0, 3.0, True),
        (1.0, 1.0, 6.0, False),
        (3.0, 1.0, 30.0, True),
        (1.0, 9.0, 30.0, True),
        (3.0, 9.0, 900.0, False),
    ],
)
def test_a_fit_is_settled_where_its_promise_lies_inside_its_intervals(left, variance_inflation, promised, settled):
    base, found = explanation("base", None, rmse=1.6), explanation("effect", None)
    found.adequacy = Adequacy(0.0, 0.0, variance_inflation)
    found.fit = replace(found.fit, residual=np.full(80, left), converged=False, promised=promised)
    assert found.settled is settled
    assert ("did not converge" in RULES.objection_to(found, Gap(base, base, 1e-4, 1e-4))) is not settled


@pytest.mark.parametrize(("base_rmse", "held_mv", "named"), [(2.0, 1.2, False), (50.0, 1.2, True), (50.0, 15.0, False)])
def test_who_is_far_ahead_need_not_have_converged(base_rmse, held_mv, named):
    base, found = explanation("base", None, rmse=base_rmse), explanation("effect", None, rmse=1.5)
    base.rmse_v, base.held_rmse_v = 50e-3, 20e-3
    found.rmse_v, found.held_rmse_v = 1.5e-3, 1e-3 * held_mv
    found.adequacy = Adequacy(0.0, 0.0, 1.0)
    found.fit = replace(found.fit, residual=np.full(80, 1.0), converged=False)
    assert not found.settled
    assert bic_difference(base, found) > RULES.clear_bic
    assert (RULES.objection_to(found, Gap(base, base, 1e-3, 1e-3)) == "") is named


@pytest.mark.parametrize(("converged", "rmse", "rivals"), [(True, 1.2, 0), (False, 1.2, 1), (False, 2.0, 0)])
def test_a_fit_that_has_not_converged_is_a_rival_where_it_is_not_far_behind(converged, rmse, rivals):
    best, other = explanation("one", None), explanation("another", None, rmse)
    other.adequacy = Adequacy(0.0, 0.0, 1.0)
    other.fit = replace(other.fit, converged=converged)
    assert bic_difference(other, best) > RULES.clear_bic
    assert len(RULES.rivals(best, [other])) == rivals


def test_the_gap_is_measured_from_the_base_fit_that_comes_nearest():
    """The likelihood is blind to how far off the averages of a cell that runs empty early are."""
    likelier, nearest = explanation("base", None, rmse=10.0), explanation("base", None, rmse=12.0)
    likelier.rmse_v, nearest.rmse_v = 100e-3, 12e-3
    found = explanation("effect", None, rmse=2.0)
    found.adequacy, found.rmse_v, found.held_rmse_v = Adequacy(0.0, 0.0, 1.0), 10e-3, 0.5e-3
    assert RULES.objection_to(found, Gap(likelier, likelier, 1e-4, 1e-3)) == ""
    assert "of the squared misfit only" in RULES.objection_to(found, Gap(likelier, nearest, 1e-4, 1e-3))


def test_what_is_no_better_than_the_base_model_is_no_partial_explanation():
    base, worse = explanation("base", None), explanation("cold", None, rmse=2.0)
    base.adequacy = worse.adequacy = Adequacy(0.0, 0.0, 1.0)
    findings = RULES.decide(Gap(base, base, 1e-4, 1e-4), [worse])
    assert (findings.verdict, findings.best) == ("unexplained", base)
    assert "cold: does not beat the base model" in findings.reason
    assert findings.explanations == [worse]


@pytest.mark.parametrize(
    ("base_rmse", "held_mv", "noise_p", "suffices"),
    [(3.0, 1.9, 0.5, False), (1.2, 1.9, 0.5, True), (3.0, 2.3, 0.5, True), (1.2, 1.9, 1e-4, False)],
    ids=["far ahead", "ahead", "predicts worse", "no noise"],
)
def test_noise_suffices_unless_an_explanation_is_far_ahead(base_rmse, held_mv, noise_p, suffices):
    base, found = explanation("base", None, rmse=base_rmse), explanation("cause", None)
    base.adequacy = Adequacy(noise_p, noise_p, 1.0)
    base.held_rmse_v, found.held_rmse_v = 2e-3, 1e-3 * held_mv
    gap = Gap(base, base, 1e-4, 1e-4)
    assert RULES.noise_suffices(gap, [found]) is suffices
    assert RULES.noise_suffices(gap, []) is (noise_p > 0.1)
    findings = RULES.decide(gap, [found])
    assert (findings.verdict == "no-missing-effect") is suffices
    assert findings.explanations == [found]
    if suffices:
        assert (findings.best, findings.gap.nearest) == (base, base)
        assert findings.reason == "noise explains the residual (size p = 0.5, structure p = 0.5)"


def test_what_was_noise_before_has_no_share_that_is_closed() -> None:
    assert closed(4.0, 1.0, 1.0) == 1.0
    assert closed(5.0, 3.0, 0.0) == pytest.approx(0.64)
    assert closed(1.0, 5.0, 0.0) < 0
    assert math.isnan(closed(1.0, 5.0, 1.2))
    assert math.isnan(closed(1.0, 1.0, 1.2))
