"""The posterior of a fit, from the simulations of the search and further ones at its draws.

Along weakly determined directions no linear or quadratic model of the residuals holds: the cost of its draws may be
hundreds of times what it predicts. Therefore an emulator learns the residuals, its draws are simulated, and it learns
from these too.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from ..comparison.robust_loss import robust
from ..prior import Prior
from ..threads import on_one_thread
from ..trajectory import FloatArray
from .emulator import Emulator, learn
from .identifiability import DRAWS_KEPT, effective_noise
from .posterior import MOVES, beginning, going_on, sample

_ROUNDS = 6
"""Rounds of simulations at draws."""

_AT_ONCE, _FOR_EACH = 16, 2
"""Simulations a round at least, and for each parameter: with nine about as many in all as a search makes, with twenty
twice as many."""

_FAR_OFF = 20.0
"""Standard deviations beyond which a residual is reduced to its order of magnitude. A cell that is empty before its
record ends is thousands of deviations off, and such residuals would decide all that the emulator learns."""

_IDLE_ROUNDS = 2
"""Rounds in a row whose draws come out no nearer to what was predicted, after which no more are simulated: an emulator
of 22 parameters of a measured cell learns little. The other three rounds brought the median error from 78 to 40 squared
deviations (CALCE CS2_35), and from 1,004 to 1,094 (NASA B0005). Not where the budget leaves fewer draws a round."""

_SETTLED = 1.0
"""Squared deviations by which the emulator may be off at nine of ten simulated draws when no more are needed.

The tenth is not the median, since the ends of a valley are found last.
"""

_CHOICE = 8
"""Draws for every second simulation; the one where the emulator is least certain is simulated: valleys end there."""

_LOOKING = 500
"""Moves of a sample that only says where to simulate next."""

_FAR = 100.0
"""Root-mean-square residual, in deviations, from which a simulation tells nothing of the neighbourhood of a fit."""

_MOST = 400
"""Simulations that an emulator learns from: its time grows with their third power, and is some seconds at so many."""

_SAME = 1e-12

_LIKELIER = 0.95
"""Share of the draws that are likelier than the least likely point of the region that holds 95 %."""


@dataclass(frozen=True, eq=False)
class SimulatedPosterior:
    """A sample, and what it stands on."""

    draws: FloatArray  # In the unit box. Shape (n, p).
    excess: float  # By what factor residuals are larger than their deviations.
    # Whether the best simulation before the sample is among its likelier 95 %: if not, others come clearly nearer.
    holds_best: bool
    # By what factor the sample was widened since draws did not come out as predicted when simulations ended; 1 if they
    # did.
    widened: float
    cut_short: bool  # Whether fewer simulations were allowed than all rounds take.
    # Where draws do not come out as predicted, points that were simulated and follow the records as draws should, shape
    # (k, p) in the unit box: what draws do in another record is then not what the records leave open. Else empty.
    followed: FloatArray


@on_one_thread
def simulated_posterior(
    points: Sequence[FloatArray],
    residuals: Sequence[FloatArray],
    jacobian: FloatArray,
    simulate: Callable[[FloatArray], Sequence[FloatArray | None]],
    prior: Prior,
    rounds: int = _ROUNDS,
    at_once: int | None = None,
    most: int | None = None,
) -> SimulatedPosterior:
    """A sample of the posterior.

    Parameters
    ----------
    points : sequence of ndarray of shape (p,)
        What was simulated, the best first.
    residuals : sequence of ndarray of shape (m,)
        What came of it, in deviations.
    jacobian : ndarray of shape (m, p)
        Derivatives at the best, likewise.
    simulate : callable
        Residuals at points of shape (k, p), likewise; None for one that fails.
    rounds, at_once : int, optional
        How often draws are simulated and learnt from at most, and how many; by default the more, the more parameters.
    most : int, optional
        Simulations that all rounds may take together, a pair in each at least.

    Notes
    -----
    Where draws have not come out as predicted when simulations end, the errors of the last predictions count as further
    noise. Those of all rounds are learnt from too, so that with as many draws a round as are wanted half of the last
    ones may be off by `_SETTLED`; with fewer, a tenth. Where no draw could be simulated, as much noise again is assumed
    as there was.
    """
    seen, found = np.array(points), np.array(residuals)
    # Residuals without weight (late pulses, the temperature in long rests) are left out: they are no small residuals.
    weighs = np.any(found != 0.0, axis=0) | np.any(jacobian != 0.0, axis=1)
    found, jacobian = found[:, weighs], jacobian[weighs]
    scale = effective_noise(found[0], seen.shape[1], 1.0)
    found = _reduced(found, scale)
    at_once = at_once or max(_AT_ONCE, _FOR_EACH * seen.shape[1])
    affordable = at_once if most is None else max(min(most // rounds, at_once), 2)
    cut_short = affordable < at_once
    rng = np.random.default_rng(0)
    emulator: Emulator | None = None
    walkers = draws = np.zeros((0, 0))
    off = typical = least = np.inf
    idle = 0
    for number in range(rounds + 1):
        usable = _usable(seen, found)
        emulator = learn(prior.as_wide_as_the_box(seen[usable]), found[usable], emulator)
        # Where the model does not come down to the noise, and where neighbours are correlated, residuals tell less.
        excess = effective_noise(found[usable[0]], seen.shape[1], 1.0)
        costs = _posterior_cost(emulator, excess, prior)
        if number == 0:
            centre = prior.normal(seen[0])
            walkers = beginning(centre, found[0] / excess, jacobian * prior.slopes(centre) / excess)
        else:
            walkers = going_on(draws, costs)
        draws = sample(costs, walkers, _LOOKING)
        if number == rounds or off < _SETTLED or idle == _IDLE_ROUNDS:
            break
        wanted = prior.unit(_wanted(emulator, draws, affordable, prior, rng))
        more = simulate(wanted)
        done = [place for place, residual in enumerate(more) if residual is not None]
        if done:
            made = _reduced(np.array([more[place] for place in done])[:, weighs], scale)
            places = prior.as_wide_as_the_box(wanted[done])
            missed = np.sum((emulator.residuals(places) - made) ** 2, axis=1)
            off, typical = (float(np.quantile(missed, share)) / excess**2 for share in (0.9, 0.5))
            seen, found = np.vstack([seen, wanted[done]]), np.vstack([found, made])
        idle = 0 if typical < least or cut_short else idle + 1
        least = min(least, typical)
    widened = 1.0
    assert emulator is not None
    if (off if cut_short else typical) >= _SETTLED:
        # The cost of draws is about the number of parameters: an error as large doubles the variance.
        widened = float(np.sqrt(1.0 + (typical / seen.shape[1] if np.isfinite(typical) else 1.0)))
        costs = _posterior_cost(emulator, widened * excess, prior)
    followed = _spread_within(seen, found / excess, prior) if widened > 1.0 else seen[:0]
    draws = prior.unit(sample(costs, going_on(draws, costs), MOVES))
    unlikely = _unlikeliness(emulator, widened * excess, prior, np.vstack([seen[:1], draws]))
    holds_best = bool(unlikely[0] <= np.quantile(unlikely[1:], _LIKELIER))
    return SimulatedPosterior(draws, excess, holds_best, widened, cut_short, followed)


def _spread_within(points: FloatArray, residuals: FloatArray, prior: Prior) -> FloatArray:
    """Some simulated points in the region that holds 95 % of the posterior, far apart from one another.

    ``points``, of shape (n, p), the fit first, have ``residuals`` in deviations, of shape (n, m). The region ends where
    a quadratic cost is higher than the least one by the quantile of chi-squared with p degrees of freedom. Of each next
    point the distance from the fit and from those before is the largest that there is.
    """
    places = prior.normal(points)
    costs = np.sum(residuals**2, axis=1) + np.sum(places**2, axis=1)
    within = np.flatnonzero(costs <= costs.min() + chi2.ppf(_LIKELIER, points.shape[1]))
    chosen: list[int] = []
    apart = np.sum((places[within] - places[0]) ** 2, axis=1)
    while len(chosen) < DRAWS_KEPT and apart.max() > 0.0:
        chosen.append(int(within[np.argmax(apart)]))
        apart = np.minimum(apart, np.sum((places[within] - places[chosen[-1]]) ** 2, axis=1))
    return points[chosen]


def _reduced(residuals: FloatArray, scale: float) -> FloatArray:
    """Residuals of which the far ones count by their order of magnitude."""
    return scale * robust(residuals / scale, _FAR_OFF)


def _posterior_cost(emulator: Emulator, excess: float, prior: Prior) -> Callable[[FloatArray], FloatArray]:
    """Twice the negative logarithm of the posterior in the coordinates of `Prior.normal`."""
    likelihood = emulator.cost_function(excess**2)

    def cost(points: FloatArray) -> FloatArray:
        places = prior.as_wide_as_the_box(prior.unit(points))
        return np.asarray(likelihood(places) + np.sum(points**2, axis=1))

    return cost


def _unlikeliness(emulator: Emulator, excess: float, prior: Prior, points: FloatArray) -> FloatArray:
    """Twice the negative logarithm of the posterior at points of the unit box, shape (k, p)."""
    likelihood = emulator.cost_function(excess**2)(prior.as_wide_as_the_box(points))
    return np.asarray(likelihood + np.sum(prior.deviations(points) ** 2, axis=1))


def _wanted(emulator: Emulator, draws: FloatArray, count: int, prior: Prior, rng: np.random.Generator) -> FloatArray:
    """Draws to simulate: half of them at random, half of them where the emulator is least certain."""
    some = draws[rng.choice(len(draws), count // 2 * (1 + _CHOICE))]
    usual, others = np.split(some, [count // 2])
    variance = emulator.predict(prior.as_wide_as_the_box(prior.unit(others)))[1]
    unsure = np.sum(variance, axis=1).reshape(-1, _CHOICE)
    return np.vstack([usual, others.reshape(-1, _CHOICE, others.shape[1])[np.arange(len(unsure)), unsure.argmax(1)]])


def _usable(points: FloatArray, residuals: FloatArray) -> FloatArray:
    """Places of the simulations to learn from, the best first, each point once."""
    size = np.sqrt(np.mean(residuals**2, axis=1))
    chosen: list[int] = []
    for place in np.argsort(size, kind="stable"):
        far = size[place] > max(_FAR, size[chosen[0]] if chosen else 0.0)
        again = any(np.max(np.abs(points[place] - points[other])) < _SAME for other in chosen)
        if not (far or again) and len(chosen) < _MOST:
            chosen.append(int(place))
    return np.array(chosen or [int(np.argmin(size))])
