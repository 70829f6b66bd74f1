"""The fit of the base model: from coarse to fine, from several places, and once more with its misfit as noise."""

from dataclasses import replace
from functools import partial

import numpy as np

from ..errors import BsaError
from ..inference.refit import Refit, slopes_at
from ..target import InitialSoc
from ..trajectory import FloatArray
from .explanation import NEAR_V, Explanation
from .first_cycles import first_cycle, near_cycles
from .fitting import REFIT_BUDGET, Fitter
from .judgement import errors_in_words
from .rules import bic_difference

_COARSE_V = 0.03
"""Misfit with which the base fit begins, V."""

_BUDGET = 110
"""Simulations of the base fit at most."""

CELL_SHIFTS, _SOC_SHIFTS = (0.0, 0.5, 1.0, 1.5), (0.0, 3.0, -4.0)
"""Where a base fit may start, in standard deviations of the priors from the given start: all parameters of the cell
towards more charge and faster transport, and the initial states of charge. A cell that is empty before its record ends
is no start."""

_STARTS = 6
"""Places from which the fit of a first cycle may start: it takes seconds, and all later fits start from it."""


def calibrate(fitter: Fitter, starts: int = 2, seed: int = 0) -> Explanation:
    """Fit the base model until converged, correct for the mesh, and fit again.

    It starts from ``starts`` places at most: a second one where noise is left, more while the fit is not even
    near. What else is found on the way is kept by the fitter: ``as_new`` and ``low``.
    """
    problem = fitter.problem
    new = first_cycle(problem)
    if new is not None:
        fitter.say("first cycle alone:")
        early_fitter = fitter.on(new)
        first = calibrate(early_fitter, _STARTS, seed)
        fitter.as_new = (first if first.adequacy.adequate else temper(early_fitter, first)).fit.u
    fitter.say("fitting the base model")
    start = np.zeros(len(fitter.space)) if fitter.as_new is None else fitter.as_new
    low = problem.shifted_low_fidelity((), fitter.space.at(start))
    if low is not None:
        fitter.low = fitter.on(low)
    fit = _coarse_fit(fitter, start)
    problem.correct_mesh((), fit.candidate)
    fitter.say(f"mesh and tolerances: {1e3 * problem.mesh_v:.2f} mV, corrected")
    fit = fitter.onwards((), fit, _BUDGET)
    base = fitter.explain((), fit)
    rng = np.random.default_rng(seed)
    for number in range(1, starts if fitter.as_new is None else 1):
        if base.adequacy.adequate or (number > 1 and base.misfit_v < NEAR_V):
            break
        # A poor fit may be a poor start: try another before calling it missing physics.
        start = np.array([rng.normal() if p.prior else u for p, u in zip(fitter.space, fit.u, strict=True)])
        there = fitter.on_low_fidelity(base)
        other = (there[0] if there else fitter).fit((), start, _BUDGET // 2)
        if other is not None and other.cost < 0.98 * fit.cost:
            again = fitter.fit((), other.u, _BUDGET) if there else fitter.onwards((), other, _BUDGET)
            if again is not None and again.cost < fit.cost:
                fit = again
                base = fitter.explain((), fit)
    if not base.adequacy.adequate:
        base = fitter.exact(base)
    fitter.say(f"base model: {errors_in_words(base)}")
    return base


def _coarse_fit(fitter: Fitter, start: FloatArray) -> Refit:
    """The base model before it is weighed against the noise alone; on the cheaper model first, if there is one.

    Each fit counts as noise what the one before it could not explain: one that begins with the noise alone may end
    where curves are steep.
    """
    fitter.problem.misfit_v = _COARSE_V
    fit: Refit | None = None
    if fitter.low is not None:
        near = _coarse_fit(fitter.low, start)
        fit = fitter.fit((), near.u, _BUDGET // 2, 2e-2)
    fit = fit or _fit_from_somewhere(fitter, start)
    for _ in range(3):
        left = fitter.explain((), fit).misfit_v
        left = left if left > NEAR_V else 0.0
        if left > 0.7 * fitter.problem.misfit_v:
            break
        fitter.problem.misfit_v = left
        fit = fitter.onwards((), fit, _BUDGET // 2, 1e-2)
        if left == 0.0:
            break
    return fit


def _fit_from_somewhere(fitter: Fitter, start: FloatArray) -> Refit:
    # A cell that is too small, or too slow for its current, is empty before its record ends, and a fit that
    # starts there does not converge: it starts from the best of some larger, faster and less full cells.
    states = np.array([isinstance(p.target, InitialSoc) for p in fitter.space])
    larger = [start + cell * fitter.of_cell + soc * states for cell in CELL_SHIFTS for soc in _SOC_SHIFTS]
    best = fitter.nearest((), [larger])
    # The state of charge is well known from a rested voltage: a start with a lower cost may end with a higher one.
    places = [] if best is None else [best] if np.array_equal(best, start) else [best, start]
    fit = partial(fitter.fit, (), budget=_BUDGET, tolerance=2e-2)
    found = fitter.problem.side_by_side([partial(fit, place) for place in places])
    fits = [one for one in found if one is not None]
    if not fits:
        raise BsaError(
            "the base model cannot follow the record's current from any initial state of charge.",
            "check the sign of the current and the capacity of the parameter set.",
        )
    return min(fits, key=lambda fit: fit.cost)


def without(fitter: Fitter, base: Explanation, best: Explanation) -> Explanation:
    """The base model, fitted once more from where an explanation ended with its effect taken away.

    An explanation that is better for its better start only, its effect next to nothing, is no explanation.
    """
    fitter.problem.misfit_v = best.counts_as_noise_v
    fit = fitter.fit((), best.fit.u[: len(fitter.space)], _BUDGET // 2)
    if fit is None:
        return base
    again = fitter.finished((), fit, _BUDGET // 2)
    if not again.adequacy.adequate:
        again = fitter.exact(again)
    return again if again.adequacy.adequate or bic_difference(base, again) > 0 else base


def temper(fitter: Fitter, base: Explanation) -> Explanation:
    """Fit the base model again with its misfit taken for noise.

    Weighed against the noise, the fit of a model that lacks an effect moves parameters far from their priors, which
    hides the effect; weighed against its own misfit, it keeps them near their priors.
    """
    fitter.problem.misfit_v = base.inflated_noise_v
    refitted = fitter.again(base, REFIT_BUDGET // 2)
    if not refitted.fit.fresh and fitter.low is None:
        # Scores and short fits stand on this Jacobian: after many updates it is no derivative any more.
        fit = refitted.fit
        refitted.fit = replace(fit, jacobian=slopes_at(fitter.residuals(base.effects), fit))
    return refitted


def near_new(fitter: Fitter) -> tuple[Fitter, Explanation] | None:
    """Records of many cycles up to where the cell as it was new has drifted far, and the base model there.

    Over all cycles ageing is too strong for a score test, which is linear. None where no record drifts far.
    """
    if fitter.as_new is None:
        return None
    predictions = fitter.problem.predict((), fitter.space.at(fitter.as_new))
    cut = None if predictions is None else near_cycles(fitter.problem, fitter.problem.errors(predictions))
    if cut is None:
        return None
    near = fitter.on(cut)
    here = near.at((), fitter.as_new)
    if here is None:
        return None
    near.problem.misfit_v = here.inflated_noise_v
    fit = near.fit((), fitter.as_new, 1 + len(fitter.space))
    return None if fit is None else (near, near.explain((), fit))
