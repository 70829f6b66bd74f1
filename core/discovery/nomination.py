"""Which effects of a catalogue are worth a refit: score tests, and short refits from a ladder of strengths."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..effect import Effect, Evidence
from ..parameters import ParameterSpace
from ..trajectory import FloatArray
from .explanation import Explanation
from .findings import Listener, Nomination
from .fitting import Fitter
from .refit import Refit
from .rules import CLEAR_BIC
from .score import Score, score_effect, trusted_step

_REACH = 3.0
"""Standard deviations of the priors by which base parameters move along with an effect before anything is fitted."""

_SHARES = (1.0, 0.3, 0.0)
"""Shares of that move that are tried."""

_SHORT = 12
"""Simulations of a short refit."""

_ENOUGH = 0.5
"""Share of what a score promises that a short refit has to keep: one step that goes wrong uses its slopes up."""

_OVERFITTED = 10.0
"""Cost of the priors above which the base model counts as overfitted."""

_EASES = (0.0, 0.5, 1.0)
"""Standard deviations of the priors by which base parameters start larger and faster, where a fit was no help."""

_RUNGS = (0.5, 1.0, 3.0, 10.0, 32.0, 100.0, 320.0)
"""Strengths from which a short refit may start, in probes."""


def nominate(
    fitter: Fitter, base: Explanation, catalogue: Sequence[Effect], evidence: Evidence, listener: Listener
) -> list[Nomination]:
    """Score every effect of a catalogue on what the base model leaves, the most promising first."""
    nominations = [Nomination(e, e.lacks(evidence) if e.lacks is not None else "") for e in catalogue]
    shown = [nomination for nomination in nominations if not nomination.lacks]
    sensitivities = sensitivities_of(fitter, base, [nomination.effect for nomination in shown])
    for nomination, sensitivity in zip(shown, sensitivities, strict=True):
        if sensitivity is None:
            nomination.lacks = "could not be simulated at the base fit"
        else:
            nomination.sensitivity, nomination.deviation = sensitivity, fitter.problem.deviation()
            nomination.score = score_of(base, nomination.effect, sensitivity)
    nominations.sort(key=lambda n: -(n.score.gain if n.score else -1.0))
    for n in nominations[:6]:
        if n.score:
            share = n.score.gain / max(base.fit.chi2, 1.0)
            listener(f"  {n.effect.key}: z {n.score.z:+.1f}, predicted gain {share:.0%}")
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
        found.append(Nomination(known.effect, "", score_of(first, known.effect, sensitivity), sensitivity, deviation))
    return sorted(found, key=lambda n: -n.gain)


def sensitivities_of(fitter: Fitter, explanation: Explanation, effects: Sequence[Effect]) -> list[FloatArray | None]:
    """Derivatives of the weighted residual by the strength (per probe) of each effect, given an explanation.

    Against the effect's own null rather than the base model: an option may change the approximation a
    little even at strength zero, and that is not the effect.
    """
    wanted = []
    for effect in effects:
        on = {effect.full_name(p): p.probe for p in effect.parameters}
        off = on | {effect.full_name(effect.strength): effect.strength.null}
        wanted += [((*explanation.effects, effect), explanation.fit.candidate | values) for values in (on, off)]
    found = fitter.problem.residuals(wanted)
    sensitivities: list[FloatArray | None] = []
    for lit, dark in zip(found[::2], found[1::2], strict=True):
        sensitivities.append(None if lit is None else lit - (explanation.fit.residual if dark is None else dark))
    return sensitivities


def score_of(explanation: Explanation, effect: Effect, sensitivity: FloatArray) -> Score:
    """Score an effect on what an explanation leaves."""
    fit = explanation.fit
    return score_effect(fit.residual, fit.jacobian, sensitivity, fit.space, fit.u, _ends(effect))


def most_simulations(space: ParameterSpace) -> int:
    """Simulations of one short refit beside the parameters of a space at most."""
    return len(_RUNGS) * len(_SHARES) + 2 * _SHORT + len(space) + 1


def screen(fitter: Fitter, before: Explanation, nomination: Nomination, as_new: bool = False) -> None:
    """Give a nomination a short refit beside what is known, and note what the temperature says of it.

    ``as_new`` says that the base parameters are those of the cell before it aged, and only its ageing is to be
    found.
    """
    _note(fitter, before, nomination, _short_refit(fitter, before, nomination, as_new))


def screen_afresh(fitter: Fitter, before: Explanation, nomination: Nomination) -> None:
    """Give a nomination whose score promised little refits on slopes of their own, from strengths of either sign.

    A score is linear. Where an effect moves the minute at which a cell is empty (a leak, an offset of the current), a
    base model whose parameters were fitted to the effect leaves a residual that derivatives there do not predict.
    """
    low, high = _ends(nomination.effect)
    ladder = _ladder(nomination)
    for rungs in (ladder, [-rung for rung in ladder if 0.95 * low <= -rung <= 0.95 * high]):
        along = _climb(rungs, partial(_moved_along, fitter, before, nomination, _SHARES), before.cost)
        starts = [along, *(_from_priors(fitter, before, nomination, rungs) if is_lost(before) else ())]
        _refit_from_best(fitter, before, nomination, starts, 2)


def screen_from_priors(fitter: Fitter, before: Explanation, nomination: Nomination) -> None:
    """Give a nomination a short refit from the means of the priors, on slopes taken there.

    A model that lacks a strong effect moves its parameters far to hide that, or is lost on the way.
    """
    _refit_from_best(fitter, before, nomination, _from_priors(fitter, before, nomination, _ladder(nomination)), 1)


def is_lost(explanation: Explanation) -> bool:
    """Whether the base parameters are far from their priors, or have not converged."""
    return explanation.fit.prior_cost > _OVERFITTED or not explanation.fit.converged


def _refit_from_best(
    fitter: Fitter, before: Explanation, nomination: Nomination, starts: Sequence[_Start | None], length: int
) -> None:
    """A short refit on slopes of its own from the best of some starts."""
    found = [start for start in starts if start is not None]
    if found:
        best = min(found, key=lambda start: start.price).refit
        effects, budget = (*before.effects, nomination.effect), length * (_SHORT + len(best.space))
        _note(fitter, before, nomination, fitter.fit(effects, best.space, best.u, budget))


def _note(fitter: Fitter, before: Explanation, nomination: Nomination, found: Refit | None) -> None:
    if found is None:
        return
    temperature_misfit = fitter.temperature_misfit((*before.effects, nomination.effect), found.candidate)
    if found.cost + temperature_misfit < nomination.promise:
        nomination.screened, nomination.temperature_misfit = found, temperature_misfit


def _short_refit(fitter: Fitter, before: Explanation, nomination: Nomination, as_new: bool) -> Refit | None:
    """A few Broyden steps from a known explanation, with its Jacobian and the effect's sensitivity.

    A strong effect is far from where the linear picture of its probe points: the steps start from the best rung of a
    ladder of strengths. Parameters of a new cell stay where they are at first.
    """
    effects = (*before.effects, nomination.effect)
    shares, budget = ((0.0,), 2 * _SHORT) if as_new else (_SHARES, _SHORT)
    start = _climb(_ladder(nomination), partial(_moved_along, fitter, before, nomination, shares), before.cost)
    if start is None:
        return None
    space = start.refit.space
    found = fitter.fit(effects, space, start.refit.u, budget, jacobian=start.refit.jacobian)
    promised = nomination.gain
    if found is not None and promised > CLEAR_BIC and before.fit.cost - found.cost < _ENOUGH * promised:
        # Much was promised and little came of it: the slopes were wrong.
        again = fitter.fit(effects, space, found.u, budget + len(space))
        found = found if again is None or found.cost < again.cost else again
    return found


@dataclass(frozen=True, eq=False)
class _Start:
    """Where a short refit may begin; ``price`` is its cost with what the temperature says."""

    price: float
    refit: Refit


def _climb(
    ladder: Sequence[float], start_at: Callable[[float], _Start | None], ahead: float = float("inf")
) -> _Start | None:
    """The best rung, given up after two in a row that come no nearer."""
    best: _Start | None = None
    worse = 0
    for strength in ladder:
        found = start_at(strength)
        worse += 1
        if found is not None and found.price < (ahead if best is None else min(ahead, best.price)):
            worse = 0
        if found is not None and (best is None or found.price < best.price):
            best = found
        if worse == 2:
            break
    return best


def _moved_along(
    fitter: Fitter, before: Explanation, nomination: Nomination, shares: Sequence[float], strength: float
) -> _Start | None:
    """With the base parameters moved along, as far as the linear picture goes; less far where it misleads."""
    assert nomination.sensitivity is not None
    known = before.fit
    others = [0 * nomination.sensitivity] * (len(nomination.effect.parameters) - 1)
    there = known.residual + strength * nomination.sensitivity
    whole, _ = trusted_step(known.jacobian, there, known.space, known.u, _REACH)
    best: _Start | None = None
    for step in (share * whole for share in shares):
        found = _start(fitter, before, nomination, known.u + step, strength)
        if found is None:
            continue
        # The secant from the null is a better slope for a strong effect than the tangent at the null.
        secant = (found.refit.residual - known.residual - known.jacobian @ step) / strength
        jacobian = np.column_stack([known.jacobian, secant, *others])
        if best is None or found.price < best.price:
            best = _Start(found.price, replace(found.refit, jacobian=jacobian))
        if found.price < before.cost:
            break
    return best


def _from_priors(
    fitter: Fitter, before: Explanation, nomination: Nomination, ladder: Sequence[float]
) -> list[_Start | None]:
    """The best strengths with the base parameters at the means of the priors, or as in a new cell.

    A cell that runs empty before its record does is no start either, so that roomier and faster ones are among them;
    the charge is the fitted one, and the one that a rested voltage tells.
    """
    count = len(fitter.space)
    fitted = before.fit.u[:count]
    prior = fitter.space.prior_weights > 0
    bases = [np.where(prior, 0.0, fitted)] + [np.where(prior, ease, 0.0) for ease in _EASES]
    if fitter.as_new is not None:
        bases = [fitter.as_new]
    places = [np.concatenate([base, before.fit.u[count:]]) for base in bases]
    return [_climb(ladder, partial(_start, fitter, before, nomination, place)) for place in places]


def _start(
    fitter: Fitter, before: Explanation, nomination: Nomination, u: FloatArray, strength: float
) -> _Start | None:
    effects = (*before.effects, nomination.effect)
    space = ParameterSpace((*before.fit.space, *nomination.effect.searched))
    # The strength's coordinate is 0 at the probe and -1 at the null.
    there = np.concatenate([u, [strength - 1.0], np.zeros(len(nomination.effect.parameters) - 1)])
    candidate = space.at(there)
    here = fitter.residuals(effects)([candidate])[0]
    if here is None:
        return None
    found = Refit(space, there, here, before.fit.jacobian, False, 1)
    return _Start(found.cost + fitter.temperature_misfit(effects, candidate), found)


def _ladder(nomination: Nomination) -> list[float]:
    """Strengths to start from, in probes from the null, towards the side that the score asks for."""
    assert nomination.score is not None
    low, high = _ends(nomination.effect)
    wanted = nomination.score.amplitude
    sign = -1.0 if wanted < 0 or high <= 0 else 1.0
    rungs = {sign * size for size in _RUNGS} | {wanted}
    return sorted((rung for rung in rungs if 0.95 * low <= rung <= 0.95 * high and rung), key=abs)


def _ends(effect: Effect) -> tuple[float, float]:
    """Bounds of an effect's strength in probes from the null."""
    strength = effect.strength
    unit = strength.probe - strength.null
    low, high = sorted(((strength.lower - strength.null) / unit, (strength.upper - strength.null) / unit))
    return low, high
