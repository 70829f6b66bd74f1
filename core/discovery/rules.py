"""The rules by which an explanation is accepted, and two are called indistinguishable."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .explanation import Explanation, clearly_nearer

CLEAR_BIC = 10.0
"""Difference in BIC from which one explanation is clearly better than another (Kass and Raftery 1995)."""

FAR_AHEAD = 100.0
"""Difference in BIC that is asked of an explanation whose fit got stuck: what more it could gain would not turn it."""

CLEAR_HELD = 0.9
"""An explanation predicts data not fitted clearly better where its error is below this share of the other's."""

CLOSED_ENOUGH = 0.75
"""Share of the excess variance that a named explanation must close: the error beyond noise is halved, as that of a
temperature must be. Below it is a partial explanation."""

CLOSED_FITTED = 0.5
"""The same on fitted data, where data that was not fitted shows the gap too. A base model bends its parameters to what
it is fitted to and hides part of its gap there, so that what an effect closes of it is understated."""


def bic(explanation: Explanation, scale: Explanation) -> float:
    r"""BIC of an explanation by quasi-likelihood, on the scale that another one sets.

    .. math:: S / c + W + B + k \ln n

    with ``S`` the sum of squares in which the misfit of ``scale`` counts as noise, and ``c`` its dispersion, so that
    neighbours which repeat one another, and what neither explains, do not count as evidence (Burnham and Anderson
    2002, doi:10.1007/b97636, section 2.5); ``W`` the squared error of the temperature, which no fit is shown, as one
    observation with a deviation of `TEMPERATURE_DEVIATION_K`; ``B`` the cost of the priors; ``k`` the number of
    parameters and ``n`` that of observations.
    """
    misfit = scale.misfit_v
    squares = explanation.chi2(misfit) / scale.dispersion(misfit)
    size = len(explanation.fit.space) * float(np.log(len(scale.errors)))
    return squares + explanation.temperature_misfit + explanation.fit.prior_cost + size


def bic_difference(worse: Explanation, better: Explanation) -> float:
    """BIC of one explanation minus that of another, on the scale of the better one."""
    return bic(worse, better) - bic(better, better)


def closed(before_v: float, after_v: float, noise_v: float) -> float:
    """Share of the excess variance that is gone: ``1 - (after^2 - noise^2) / (before^2 - noise^2)``."""
    excess = before_v**2 - noise_v**2
    return 1.0 if excess <= 0 else 1.0 - max(after_v**2 - noise_v**2, 0.0) / excess


def objection_to(
    base: Explanation, found: Explanation, noise_v: float, held_noise_v: float, nearest: Explanation | None = None
) -> str:
    """Why an explanation may not be named; empty if it may.

    Parameters
    ----------
    base, found : Explanation
        The base model, by its better likelihood, and the explanation.
    noise_v, held_noise_v : float
        Measurement noise of the fitted records and of the data not fitted, V.
    nearest : Explanation, optional
        The fit of the base model by which the gap is measured; ``base`` if there is one only.
    """
    margin = bic_difference(base, found)
    if margin <= CLEAR_BIC:
        return f"does not beat the base model by {CLEAR_BIC:g} in BIC"
    if not found.excludes_null:
        return "a strength's 95 % interval contains its null value, or it ran into a bound"
    if not (found.settled or found.adequacy.adequate or margin > FAR_AHEAD):
        return "its fit did not converge"
    # A base model with parameters far from their priors may come as near to the voltage; BIC counts the priors.
    # A temperature predicted clearly better, which no fit was shown, then stands for the gap that it hides.
    if not (found.adequacy.adequate or predicts_temperature(found, base)):
        material = base.held_rmse_v > 1.1 * held_noise_v
        share = closed((nearest or base).rmse_v, found.rmse_v, noise_v)
        if share < (CLOSED_FITTED if material else CLOSED_ENOUGH):
            return f"closes {share:.0%} of the gap only"
        held = closed(base.held_rmse_v, found.held_rmse_v, held_noise_v)
        if material and held < CLOSED_ENOUGH:
            return f"closes {held:.0%} of the gap in data not fitted only"
    # A measured temperature is data not fitted too: where it tells, the voltage has to be predicted about as well.
    allowed = base.held_rmse_v / (CLEAR_HELD if predicts_temperature(found, base) else 1.0)
    if not found.held_rmse_v < allowed:
        return "does not predict the data not fitted better than the base model"
    return ""


def rivals(best: Explanation, others: Sequence[Explanation]) -> list[Explanation]:
    """Explanations with other names that cannot be told from the best one.

    Either their BIC is within `CLEAR_BIC`, or they predict the data not fitted clearly better. One that predicts
    a measured temperature clearly worse, which no fit was shown, is no rival; nor is one that predicts the data not
    fitted clearly worse, if its fit has settled: what an unfinished fit predicts is no evidence against it.
    """
    found = []
    for other in others:
        if other.names == best.names or not other.excludes_null:
            continue
        if set(best.names) < set(other.names):
            continue  # the best one with an ornament is no rival
        predicts_worse = other.settled and best.held_rmse_v < CLEAR_HELD * other.held_rmse_v
        if predicts_temperature(best, other) or predicts_worse:
            continue
        difference = bic_difference(other, best)
        predicts_better = other.held_rmse_v < CLEAR_HELD * best.held_rmse_v and not best.adequacy.adequate
        if difference <= CLEAR_BIC or (predicts_better and difference <= 10 * CLEAR_BIC):
            found.append(other)
    return found


def predicts_temperature(better: Explanation, worse: Explanation) -> bool:
    """Whether one explanation predicts the measured temperature clearly better than another."""
    return clearly_nearer(better.temperature_rms_k, worse.temperature_rms_k)
