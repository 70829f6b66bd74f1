"""Which effects of a catalogue are worth a fit: score tests, and short fits from several starts."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..effect import Effect, Evidence
from ..trajectory import FloatArray
from .base_fit import CELL_SHIFTS
from .explanation import Explanation
from .findings import Nomination
from .fitting import Fitter, least
from .judgement import temperature_misfit_of
from .score import Score, score_effect, trusted_step

_SHORT = 12
"""Steps of a short fit: enough to rank effects."""

_OVERFITTED = 10.0
"""Cost of the priors above which the base model counts as overfitted."""

_SHIFTS = CELL_SHIFTS[:3]
"""Where a short fit may start if the base fit is far off, in standard deviations of the priors from their means."""

_STRENGTHS = (1.0, 3.0, 10.0, 32.0, 100.0, 320.0)
"""Strengths from which a short fit may start, in probes from the null: a strong effect is far from where the linear
extrapolation of its probe points."""


def nominate(fitter: Fitter, base: Explanation, catalogue: Sequence[Effect], evidence: Evidence) -> list[Nomination]:
    """Score every effect of a catalogue on what the base model leaves, the most promising first."""
    nominations = [Nomination(e, e.lacking(evidence)) for e in catalogue]
    shown = [nomination for nomination in nominations if not nomination.lacks]
    for nomination, sensitivity in zip(shown, _sensitivities(fitter, base, shown), strict=True):
        if sensitivity is None:
            nomination.lacks = "could not be simulated at the base fit"
        else:
            nomination.sensitivity, nomination.deviation = sensitivity, fitter.problem.deviation()
            nomination.score = score_effect(base.fit, sensitivity, _ends(nomination.effect))
    scored = [nomination for nomination in shown if nomination.score is not None]
    strong = fitter.problem.side_by_side([partial(score_where_strong, fitter, base, n) for n in scored])
    for nomination, score in zip(scored, strong, strict=True):
        nomination.score = score
    nominations.sort(key=lambda n: -(n.score.gain if n.score else -1.0))
    for n in nominations[:6]:
        if n.score:
            share = n.score.gain / max(base.fit.chi2, 1.0)
            fitter.say(f"  {n.effect.key}: z {n.score.z:+.1f}, predicted gain {share:.0%}")
    return nominations


def nominate_second(fitter: Fitter, first: Explanation, nominations: Sequence[Nomination]) -> list[Nomination]:
    """Score every other effect on what an explanation leaves, the most promising first.

    The sensitivities are those simulated at the base fit: an explanation moves the parameters little, which changes
    sensitivities much less than the residual.
    """
    found = []
    deviation = fitter.problem.deviation()
    for known in nominations:
        if known.sensitivity is None or known.deviation is None or known.effect.name in first.names:
            continue
        sensitivity = known.sensitivity * known.deviation / deviation
        score = score_effect(first.fit, sensitivity, _ends(known.effect))
        found.append(Nomination(known.effect, "", score, sensitivity, deviation, beside=first.effects))
    return sorted(found, key=lambda n: -n.gain)


def _sensitivities(fitter: Fitter, base: Explanation, nominations: Sequence[Nomination]) -> list[FloatArray | None]:
    """Derivatives of the weighted residual by the strength (per probe) of each effect, given the base model.

    Against the effect's own null rather than the base model: an option may change the approximation a
    little even at strength zero, and that is not the effect.
    """
    wanted = []
    for effect in (nomination.effect for nomination in nominations):
        on = {effect.full_name(p): p.probe for p in effect.parameters}
        off = on | {effect.full_name(effect.strength): effect.strength.null}
        wanted += [((effect,), base.fit.candidate | values) for values in (on, off)]
    found = fitter.problem.residuals(wanted)
    return [
        None if with_it is None else with_it - (base.fit.residual if without is None else without)
        for with_it, without in zip(found[::2], found[1::2], strict=True)
    ]


def score_where_strong(fitter: Fitter, before: Explanation, nomination: Nomination) -> Score:
    """The score of an effect, or that of one of its larger strengths where this promises more.

    The strengths are those from which a short fit starts. What each leaves is simulated, and the base parameters are
    moved along as their derivatives say.
    """
    fit, known = before.fit, nomination.score
    assert known is not None
    space = fitter.space_with(nomination.effects)

    def costs(strengths: Sequence[float]) -> list[float]:
        starts = [space.at(_with_effect(nomination.effect, fit.u, strength)) for strength in strengths]
        found = fitter.residuals(nomination.effects)(starts)
        return [np.inf if r is None else float(r @ r) + fit.prior_cost - trusted_step(fit, r)[1] for r in found]

    found = least([[one] for one in _strengths(nomination, _wanted_sign(nomination))], costs)
    best, left = found
    gain = fit.cost - trusted_step(fit, fit.residual)[1] - left
    return known if best is None or gain <= known.gain else replace(known, amplitude=best, gain=gain)


def most_simulations(before: Explanation) -> int:
    """Simulations of one `screen` beside what is known at most, with strengths of one sign."""
    strengths, fit = len(_STRENGTHS) + 1, _SHORT + len(before.fit.space) + 1
    return 2 * strengths + fit + ((1 + len(_SHIFTS)) * strengths + fit if _is_lost(before) else 0)


def screen(
    fitter: Fitter, before: Explanation, nomination: Nomination, as_new: bool = False, either_sign: bool = False
) -> None:
    """Give a nomination short fits beside what is known, each from the best of some starts; the best one is kept.

    One starts near the parameters of the explanation ``before``. ``either_sign`` adds one with strengths of the sign
    against which the score speaks. If these parameters are far from their priors, one more starts at the means of the
    priors. ``as_new`` keeps the parameters, which are those of the cell before it aged, where they are.
    """
    nomination.tried = True
    sign = _wanted_sign(nomination)
    ladders = [_near(before, nomination, one, as_new) for one in ((sign, -sign) if either_sign else (sign,))]
    if _is_lost(before) and not as_new:
        ladders.append(_at_priors(fitter, before, nomination, sign))
    for ladder in ladders:
        start = fitter.nearest(nomination.effects, ladder)
        found = None if start is None else fitter.fit(nomination.effects, start, _SHORT + len(start))
        if found is not None:
            temperature_misfit = temperature_misfit_of(fitter.problem, nomination.effects, found.candidate)
            if found.cost + temperature_misfit < nomination.promise:
                nomination.screened, nomination.temperature_misfit = found, temperature_misfit


def _near(before: Explanation, nomination: Nomination, sign: float, as_new: bool) -> list[list[FloatArray]]:
    """Starts with the base parameters where they are, and moved along with the effect as a linear model predicts."""
    assert nomination.sensitivity is not None
    fit, ladder = before.fit, []
    for strength in _strengths(nomination, sign):
        starts = [_with_effect(nomination.effect, fit.u, strength)]
        if not as_new:
            there = fit.residual + strength * nomination.sensitivity
            step, _ = trusted_step(fit, there)
            starts.append(_with_effect(nomination.effect, fit.u + step, strength))
        ladder.append(starts)
    return ladder


def _at_priors(fitter: Fitter, before: Explanation, nomination: Nomination, sign: float) -> list[list[FloatArray]]:
    """Starts with the base parameters at the means of their priors, or larger and faster.

    The states of charge are the fitted ones, and those that rested voltages tell.
    """
    count = len(fitter.space)
    fitted, of_cell = before.fit.u[:count], fitter.of_cell
    bases = [np.where(of_cell, 0.0, fitted)] + [np.where(of_cell, shift, 0.0) for shift in _SHIFTS]
    places = [np.concatenate([base, before.fit.u[count:]]) for base in bases]
    strengths = _strengths(nomination, sign)
    return [[_with_effect(nomination.effect, place, strength) for place in places] for strength in strengths]


def _is_lost(explanation: Explanation) -> bool:
    """Whether the base parameters are far from their priors, or have not converged.

    A model that lacks a strong effect moves its parameters far to hide that.
    """
    return explanation.fit.prior_cost > _OVERFITTED or not explanation.fit.converged


def _wanted_sign(nomination: Nomination) -> float:
    """The side of the null on which the score estimates the strength: 1 or -1."""
    _, high = _ends(nomination.effect)
    assert nomination.score is not None
    return -1.0 if nomination.score.amplitude < 0 or high <= 0 else 1.0


def _strengths(nomination: Nomination, sign: float) -> list[float]:
    """Strengths to start from, in probes from the null: fixed ones, and one of the size that the score estimates."""
    low, high = _ends(nomination.effect)
    assert nomination.score is not None
    strengths = {sign * size for size in (*_STRENGTHS, abs(nomination.score.amplitude))}
    return sorted((one for one in strengths if one and 0.95 * low <= one <= 0.95 * high), key=abs)


def _with_effect(effect: Effect, u: FloatArray, strength: float) -> FloatArray:
    # The strength's coordinate is 0 at the probe and -1 at the null.
    return np.concatenate([u, [strength - 1.0], np.zeros(len(effect.parameters) - 1)])


def _ends(effect: Effect) -> tuple[float, float]:
    """Bounds of an effect's strength in probes from the null."""
    strength = effect.strength
    unit = strength.probe - strength.null
    low, high = sorted(((strength.lower - strength.null) / unit, (strength.upper - strength.null) / unit))
    return low, high
