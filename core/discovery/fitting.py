"""Fits of explanations to a problem, alone and side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..effect import Effect
from ..inference.problem import Problem
from ..inference.refit import Refit, Residuals, refit
from ..parameters import ParameterSpace
from ..target import CurrentOffset, InitialSoc
from ..trajectory import FloatArray
from .explanation import NEAR_V, Explanation
from .findings import Listener
from .first_cycles import longer
from .judgement import against, errors_in_words, explain
from .rules import RULES

T = TypeVar("T")

Fitted = tuple[tuple[Effect, ...], Refit]
"""Effects, and a fit with them."""

LAG = 2 * RULES.clear_bic
"""Cost by which an explanation may lag behind the best one before it is dropped: twice a BIC that is clear."""

_SHARES_OF_STRENGTH = (1.0, 0.7, 1.4, 0.5, 2.0, 0.25, 4.0, 0.0)
"""Strengths to start from beside other base parameters, as shares of the fitted one; these may need none of it."""

REFIT_BUDGET = 90
"""Simulations of the fit of an explanation at most."""

_STAGE = 40
"""Simulations of a fit to part of the cycles, from a fit to half as many."""

_LEVELS = 6
"""How often the misfit that counts as noise is lowered, at most."""


def least(ladder: Iterable[Sequence[T]], costs: Callable[[Sequence[T]], Sequence[float]]) -> tuple[T | None, float]:
    """What costs least of all on a ladder, and its cost; None where every cost is infinite.

    Each rung of the ladder has some starts, the next one those of a stronger effect; after two in a row that come no
    nearer it ends, for what is far too strong is slow to simulate.
    """
    best, lowest, worse = None, np.inf, 0
    for rung in ladder:
        worse += 1
        for one, cost in zip(rung, costs(rung), strict=True):
            if cost < lowest:
                best, lowest, worse = one, cost, 0
        if worse == 2:
            break
    return best, lowest


class Fitter:
    """Fits explanations; the problem's ``misfit_v`` is what the present fits count as noise.

    ``space`` holds the parameters of the base model. Those of an explanation are these and, behind them, the effects'.
    """

    def __init__(self, problem: Problem, space: ParameterSpace, listener: Listener) -> None:
        self.problem = problem
        self.space = space
        self.as_new: FloatArray | None = None
        """Base parameters before the cell aged, shape (p,), where records of many cycles tell them."""
        self.low: Fitter | None = None
        """A fitter on the cheaper model, of which Jacobians are taken; None where there is none."""
        self.say = listener
        self._told: dict[str, str] = {}

    def on(self, problem: Problem) -> Fitter:
        """A fitter of the same base model on another problem."""
        return Fitter(problem, self.space, self.say)

    def space_with(self, effects: Sequence[Effect]) -> ParameterSpace:
        """The parameters of the base model, and those of effects."""
        return ParameterSpace((*self.space, *(parameter for effect in effects for parameter in effect.searched)))

    @property
    def of_cell(self) -> NDArray[np.bool_]:
        """Which of the parameters are the cell's own, shape (p,); the others act on one record."""
        return np.array([not isinstance(p.target, InitialSoc | CurrentOffset) for p in self.space])

    # --- fits -----------------------------------------------------------------------------------------------

    def residuals(self, effects: Sequence[Effect]) -> Residuals:
        """Weighted residuals of candidates with the effects, at the present misfit."""
        return lambda candidates: self.problem.residuals([(effects, candidate) for candidate in candidates])

    def fit(
        self,
        effects: Sequence[Effect],
        start: FloatArray,
        budget: int,
        tolerance: float = 2e-3,
        jacobian: FloatArray | None = None,
        fresh: bool = False,
    ) -> Refit | None:
        """Fit at the present misfit, from coordinates of the base model and effects; None if these cannot be simulated.

        Jacobians are taken of the cheaper model, where there is one.
        """
        slopes = None
        if self.low is not None:
            self.low.problem.misfit_v = self.problem.misfit_v
            slopes = self.low.residuals(effects)
        space = self.space_with(effects)
        found = refit(self.residuals(effects), space, start, jacobian, budget, tolerance, fresh, slopes)
        return None if found is None else replace(found, deviation=self.problem.deviation())

    def onwards(self, effects: Sequence[Effect], fit: Refit, budget: int, tolerance: float = 2e-3) -> Refit:
        """Fit on from where a fit ended, whatever misfit it was made with: its Jacobian is weighed anew."""
        deviation = self.problem.deviation()
        known = None if fit.deviation is None else deviation / fit.deviation
        jacobian = None if known is None else fit.jacobian / known[:, None]
        fresh = fit.fresh and known is not None and bool(np.all(known == 1.0))
        return self.fit(effects, fit.u, budget, tolerance, jacobian, fresh) or fit

    def nearest(self, effects: Sequence[Effect], ladder: Sequence[Sequence[FloatArray]]) -> FloatArray | None:
        """The start on a ladder with the lowest cost (`least`); None if none can be simulated."""
        space = self.space_with(effects)

        def costs(starts: Sequence[FloatArray]) -> list[float]:
            found = self.residuals(effects)([space.at(start) for start in starts])
            return [
                np.inf if one is None else float(one @ one + np.sum((space.prior_weights * start) ** 2))
                for start, one in zip(starts, found, strict=True)
            ]

        return least(ladder, costs)[0]

    def finished(self, effects: tuple[Effect, ...], fit: Refit, budget: int) -> Explanation:
        """A fit, gone on with if it has not converged, as an explanation."""
        return self.explain(effects, fit if fit.converged else self.onwards(effects, fit, budget))

    def again(self, explanation: Explanation, budget: int) -> Explanation:
        """The same explanation, fitted on from where it is with the present misfit."""
        return self.explain(explanation.effects, self.onwards(explanation.effects, explanation.fit, budget))

    def exact(self, explanation: Explanation) -> Explanation:
        """The same explanation, where its fit ends on the base model's own Jacobian."""
        if self.low is None:
            return explanation
        own, effects = self.on(self.problem), explanation.effects
        stale = replace(explanation.fit, promised=np.inf)  # its Jacobian is of the cheaper model
        return self.explain(effects, own.onwards(effects, stale, REFIT_BUDGET))

    def on_low_fidelity(self, known: Explanation) -> tuple[Fitter, Explanation] | None:
        """A fitter on the cheaper model, which is shifted to agree with an explanation, and the explanation there."""
        problem = self.problem.shifted_low_fidelity(known.effects, known.fit.candidate)
        if problem is None:
            return None
        low = self.on(problem)
        fit = low.fit(known.effects, known.fit.u, 1 + len(known.fit.space))
        return None if fit is None else (low, low.explain(known.effects, fit))

    def at(self, effects: tuple[Effect, ...], u: FloatArray) -> Explanation | None:
        """What is explained at given coordinates, without a fit; None if they cannot be simulated."""
        space = self.space_with(effects)
        here = self.residuals(effects)([space.at(u)])[0]
        if here is None:
            return None
        return self.explain(effects, Refit(space, u, here, np.zeros((len(here), len(space))), False))

    def from_neighbour(
        self, effects: tuple[Effect, ...], known: Refit, leader: Explanation, if_nearer: bool = False
    ) -> Explanation | None:
        """Effects fitted once more from the base parameters of another fit; None where that leads nowhere near it.

        The true base parameters are the same whatever effect is added. With ``if_nearer`` they are fitted only if a
        start with these parameters is better than where their own fit ended.
        """
        space, count = known.space, len(self.space)
        starts = []
        for share in _SHARES_OF_STRENGTH:
            start = np.concatenate([leader.fit.u[:count], known.u[count:]])
            # The strength's coordinate is -1 at its null.
            start[count] = np.clip(share * (start[count] + 1.0) - 1.0, space.lowest[count], space.highest[count])
            starts.append(start)
        best = self.nearest(effects, [[known.u, *starts] if if_nearer else starts])
        if best is known.u:
            return None
        fit = None if best is None else self.fit(effects, best, REFIT_BUDGET // 3)
        if fit is None or fit.cost > leader.fit.cost + LAG:
            return None
        return self.finished(effects, fit, REFIT_BUDGET)

    def taken_over(self, near: Problem, fits: Sequence[Fitted]) -> list[Explanation]:
        """Fits of this problem, of its first cycles, or of a cheaper model, as explanations of this problem.

        Those of first cycles are fitted to more and more cycles (`longer`), as long as they keep up with the best one.
        """
        if near is self.problem and self.low is None:
            return [self.explain(effects, fit) for effects, fit in fits]
        for problem in longer(self.problem, near):
            stage = self.on(problem)
            running = stage._moved(fits)
            if running:
                problem.misfit_v = max(NEAR_V, min(explanation.inflated_noise_v for explanation in running))
                running, _ = stage.race(running, _STAGE)
            fits = [(explanation.effects, explanation.fit) for explanation in running]
        return self._moved(fits)

    def _moved(self, fits: Sequence[Fitted]) -> list[Explanation]:
        """Fits of other problems on this one, not fitted yet; without those that cannot be simulated."""
        found = [self.at(effects, fit.u) for effects, fit in fits]
        return [explanation for explanation in found if explanation is not None]

    def contest(self, base: Explanation, explanations: Sequence[Explanation]) -> list[Explanation]:
        """Fit explanations side by side until the best one has converged, and tell how each did; see `race`."""
        running, dropped = self.race(explanations, REFIT_BUDGET)
        for explanation in (*running, *dropped):
            self.tell(base, explanation)
        return [*running, *dropped]

    def race(self, explanations: Sequence[Explanation], budget: int) -> tuple[list[Explanation], list[Explanation]]:
        """Fit explanations side by side, from coarse to fine; those that kept up with the best one, and the others.

        At each level the misfit of the best one counts as noise. An explanation is dropped, with the fit that it has,
        if its cost lags by more than `LAG` and its own slopes promise less than that. The last level, at which the best
        one is adequate or comes no nearer, gets the whole budget; those before it a third.
        """
        running, dropped = list(explanations), []
        for level in range(_LEVELS):
            running.sort(key=lambda e: e.cost)
            best, before = running[0], self.problem.misfit_v
            left = best.counts_as_noise_v
            last = left > 0.6 * before or left == 0.0 or level == _LEVELS - 1
            self.problem.misfit_v = min(left, before)
            fitted: list[Explanation] = []
            effort = budget if last else budget // 3
            for again in self.problem.side_by_side([partial(self.again, one, effort) for one in running]):
                ahead = min((other.cost for other in fitted), default=np.inf)
                if again.cost - (0.0 if last else again.fit.promised) > ahead + LAG:
                    dropped.append(again)
                else:
                    fitted.append(again)
            running = fitted
            if last:
                break
        return running, dropped

    def explain(self, effects: tuple[Effect, ...], fit: Refit) -> Explanation:
        """A fit with its judgement."""
        return explain(self.problem, effects, fit)

    def tell(self, base: Explanation, explanation: Explanation, unless_told: bool = False) -> None:
        """Say in one line how an explanation did, beside the base model; ``unless_told`` only what is not said yet."""
        line = f"  {explanation.label}: {errors_in_words(explanation)}, {against(base, explanation)}"
        if not (unless_told and self._told.get(explanation.label) == line):
            self.say(line)
        self._told[explanation.label] = line
