"""Fits the base model and explanations to a problem, from coarse to fine, and judges what they leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..effect import Effect
from ..errors import BsaError
from ..parameters import ParameterSpace
from ..target import CurrentOffset, InitialSoc
from ..trajectory import FloatArray
from .adequacy import judge
from .explanation import Explanation, estimates_of, temperature_misfit
from .findings import Listener, Settings
from .first_cycles import first_cycle, longer, near_cycles
from .observations import freedom_of_deviations, subset
from .problem import Problem
from .refit import Refit, Residuals, refit, slopes_at
from .rules import RULES, bic_difference
from .simulator import Prediction

Fitted = tuple[tuple[Effect, ...], Refit]
"""Effects, and a fit with them."""

_COARSE_V = 0.03
"""Misfit with which the base fit begins, V."""

_NEAR_V = 2e-3
"""A typical error below which a fit is near enough to be weighed against the noise, V."""

_CELL_SHIFTS, _SOC_SHIFTS = (0.0, 0.5, 1.0, 1.5), (0.0, 3.0, -4.0)
"""Where a base fit may start, in standard deviations of the priors from the given start: all parameters of the cell
towards more charge and faster transport, and the initial states of charge."""

LAG = 2 * RULES.clear_bic
"""Cost by which an explanation may lag behind the best one before it is dropped: twice a BIC that is clear."""

_SHARES_OF_STRENGTH = (1.0, 0.7, 1.4, 0.5, 2.0, 0.25, 4.0, 0.0)
"""Strengths to start from beside other base parameters, as shares of the fitted one; these may need none of it."""

_STAGE = 40
"""Simulations of a fit to part of the cycles, from a fit to half as many."""

_STARTS = 6
"""Places from which the fit of a first cycle may start: it takes seconds, and all later fits start from it."""

_LEVELS = 6
"""How often the misfit that counts as noise is lowered, at most."""


class Fitter:
    """Fits and judges explanations; the problem's ``misfit_v`` is what the present fits count as noise."""

    def __init__(self, problem: Problem, space: ParameterSpace, settings: Settings, listener: Listener) -> None:
        self.problem = problem
        self.space = space
        self.settings = settings
        self.as_new: FloatArray | None = None
        """Base parameters before the cell aged, shape (p,), where records of many cycles tell them."""
        self._low: Fitter | None = None
        self._say = listener
        self._told: dict[str, str] = {}

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
        space: ParameterSpace,
        start: FloatArray,
        budget: int,
        tolerance: float = 2e-3,
        jacobian: FloatArray | None = None,
        fresh: bool = False,
        exact: bool = False,
    ) -> Refit | None:
        """Fit at the present misfit; None if the start cannot be simulated.

        Jacobians are taken of the cheaper model, where there is one and not of the base model's ``exact`` ones.
        """
        slopes = None
        if self._low is not None and not exact:
            self._low.problem.misfit_v = self.problem.misfit_v
            slopes = self._low.residuals(effects)
        found = refit(self.residuals(effects), space, start, jacobian, budget, tolerance, fresh, slopes)
        return None if found is None else replace(found, deviation=self.problem.deviation())

    def onwards(
        self, effects: Sequence[Effect], fit: Refit, budget: int, tolerance: float = 2e-3, exact: bool = False
    ) -> Refit:
        """Fit on from where a fit ended, whatever misfit it was made with: its Jacobian is weighed anew."""
        deviation = self.problem.deviation()
        known = None if fit.deviation is None else deviation / fit.deviation
        jacobian = None if known is None else fit.jacobian / known[:, None]
        fresh = fit.fresh and known is not None and bool(np.all(known == 1.0)) and not exact
        return self.fit(effects, fit.space, fit.u, budget, tolerance, jacobian, fresh, exact) or fit

    def nearest(
        self, effects: Sequence[Effect], space: ParameterSpace, ladder: Sequence[Sequence[FloatArray]]
    ) -> FloatArray | None:
        """The start with the lowest cost; None if none can be simulated.

        Each rung of the ladder has some starts, the next one those of a stronger effect; after two in a row that come
        no nearer it ends, for what is far too strong is slow to simulate.
        """
        best, least, worse = None, np.inf, 0
        for starts in ladder:
            worse += 1
            found = self.residuals(effects)([space.at(start) for start in starts])
            for start, residual in zip(starts, found, strict=True):
                cost = np.inf if residual is None else residual @ residual + np.sum((space.prior_weights * start) ** 2)
                if cost < least:
                    best, least, worse = start, float(cost), 0
            if worse == 2:
                break
        return best

    def again(self, explanation: Explanation, budget: int, exact: bool = False) -> Explanation:
        """The same explanation, fitted on from where it is with the present misfit."""
        fit = self.onwards(explanation.effects, explanation.fit, budget, exact=exact)
        return self.explain(explanation.effects, fit)

    def exact(self, explanation: Explanation) -> Explanation:
        """The same explanation, where its fit ends on the base model's own Jacobian."""
        return explanation if self._low is None else self.again(explanation, self.settings.refit_budget, exact=True)

    def on_low_fidelity(self, known: Explanation) -> tuple[Fitter, Explanation] | None:
        """A fitter on the cheaper model, which is shifted to agree with an explanation, and the explanation there."""
        problem = self.problem.shifted_low_fidelity(known.effects, known.fit.candidate)
        if problem is None:
            return None
        low = Fitter(problem, self.space, self.settings, self._say)
        low.as_new = self.as_new
        fit = low.fit(known.effects, known.fit.space, known.fit.u, 1 + len(known.fit.space))
        return None if fit is None else (low, low.explain(known.effects, fit))

    def at(self, effects: tuple[Effect, ...], space: ParameterSpace, u: FloatArray) -> Explanation | None:
        """What is explained at given coordinates, without a fit; None if they cannot be simulated."""
        here = self.residuals(effects)([space.at(u)])[0]
        if here is None:
            return None
        return self.explain(effects, Refit(space, u, here, np.zeros((len(here), len(space))), False, 1))

    # --- the base model -------------------------------------------------------------------------------------

    def calibrate(self, starts: int = 2) -> tuple[Explanation, float]:
        """Fit the base model until converged, correct for the mesh, and fit again.

        It starts from ``starts`` places at most: a second one where noise is left, more while the fit is not even
        near. Returns the size of the mesh correction too, V.
        """
        problem, budget = self.problem, self.settings.base_budget
        new = first_cycle(problem)
        if new is not None:
            self._say("first cycle alone:")
            early_fitter = Fitter(new, self.space, self.settings, self._say)
            first, _ = early_fitter.calibrate(_STARTS)
            self.as_new = (first if first.adequacy.adequate else early_fitter.temper(first)).fit.u
        self._say("fitting the base model")
        start = np.zeros(len(self.space)) if self.as_new is None else self.as_new
        low = problem.shifted_low_fidelity((), self.space.at(start))
        if low is not None:
            self._low = Fitter(low, self.space, self.settings, self._say)
        fit = self._coarse_fit(start)
        mesh_v = problem.correct_mesh((), fit.candidate)
        self._say(f"mesh and tolerances: {1e3 * mesh_v:.2f} mV, corrected")
        fit = self.onwards((), fit, budget)
        base = self.explain((), fit)
        rng = np.random.default_rng(self.settings.seed)
        for number in range(1, starts if self.as_new is None else 1):
            if base.adequacy.adequate or (number > 1 and base.misfit_v < _NEAR_V):
                break
            # A poor fit may be a poor start: try another before calling it missing physics.
            start = np.array([rng.normal() if p.prior else u for p, u in zip(self.space, fit.u, strict=True)])
            there = self.on_low_fidelity(base)
            other = (there[0] if there else self).fit((), self.space, start, budget // 2)
            if other is not None and other.cost < 0.98 * fit.cost:
                again = self.fit((), self.space, other.u, budget) if there else self.onwards((), other, budget)
                if again is not None and again.cost < fit.cost:
                    fit = again
                    base = self.explain((), fit)
        if not base.adequacy.adequate:
            base = self.exact(base)
        self._say(f"base model: {errors_in_words(base)}")
        return base, mesh_v

    def _coarse_fit(self, start: FloatArray) -> Refit:
        """The base model before it is weighed against the noise alone; on the cheaper model first, if there is one.

        From coarse to fine: each fit counts as noise what the one before it could not explain, and noise alone is
        reached only by a model that comes near it. Started at the finest, a fit loses itself on the steep parts.
        """
        self.problem.misfit_v = _COARSE_V
        fit: Refit | None = None
        if self._low is not None:
            near = self._low._coarse_fit(start)
            fit = self.fit((), self.space, near.u, self.settings.base_budget // 2, 2e-2)
        fit = fit or self._fit_from_somewhere(start)
        for _ in range(3):
            left = self.explain((), fit).misfit_v
            left = left if left > _NEAR_V else 0.0
            if left > 0.7 * self.problem.misfit_v:
                break
            self.problem.misfit_v = left
            fit = self.onwards((), fit, self.settings.base_budget // 2, 1e-2)
            if left == 0.0:
                break
        return fit

    def _fit_from_somewhere(self, start: FloatArray) -> Refit:
        # A cell that is too small, or too slow for its current, is empty before its record ends, and a fit that
        # starts there does not converge: it starts from the best of some larger, faster and less full cells.
        states = np.array([isinstance(p.target, InitialSoc) for p in self.space])
        larger = [start + cell * self.of_cell + soc * states for cell in _CELL_SHIFTS for soc in _SOC_SHIFTS]
        best = self.nearest((), self.space, [larger])
        # The charge that a rested voltage tells is well known: what comes nearer elsewhere may end farther off.
        places = [] if best is None else [best] if np.array_equal(best, start) else [best, start]
        fit = partial(self.fit, (), self.space, budget=self.settings.base_budget, tolerance=2e-2)
        found = self.problem.side_by_side([partial(fit, place) for place in places])
        fits = [one for one in found if one is not None]
        if not fits:
            raise BsaError(
                "the base model cannot follow the record's current from any initial state of charge.",
                "check the sign of the current and the capacity of the parameter set.",
            )
        return min(fits, key=lambda fit: fit.cost)

    def without(self, base: Explanation, best: Explanation) -> Explanation:
        """The base model, fitted once more from where an explanation ended with its effect taken away.

        An explanation that is better for its better start only, its effect next to nothing, is no explanation.
        """
        self.problem.misfit_v = best.inflated_noise_v if best.misfit_v > _NEAR_V else 0.0
        budget = self.settings.base_budget // 2
        fit = self.fit((), self.space, best.fit.u[: len(self.space)], budget)
        if fit is None:
            return base
        again = self.explain((), fit if fit.converged else self.onwards((), fit, budget))
        if not again.adequacy.adequate:
            again = self.exact(again)
        return again if again.adequacy.adequate or bic_difference(base, again) > 0 else base

    def from_neighbour(self, effects: tuple[Effect, ...], known: Refit, leader: Explanation) -> Explanation | None:
        """Effects fitted once more from the base parameters of another fit; None where that leads nowhere near it.

        What is true of the base model is true whatever is added to it: an effect that comes near the data shows
        where the base parameters of similar ones (all that consume lithium) are.
        """
        space, count = known.space, len(self.space)
        starts = []
        for share in _SHARES_OF_STRENGTH:
            start = np.concatenate([leader.fit.u[:count], known.u[count:]])
            # The strength's coordinate is -1 at its null.
            start[count] = np.clip(share * (start[count] + 1.0) - 1.0, space.lowest[count], space.highest[count])
            starts.append(start)
        best, budget = self.nearest(effects, space, [starts]), self.settings.refit_budget
        fit = None if best is None else self.fit(effects, space, best, budget // 3)
        if fit is None or fit.cost > leader.fit.cost + LAG:
            return None
        return self.explain(effects, fit if fit.converged else self.onwards(effects, fit, budget))

    # --- misfit as noise ------------------------------------------------------------------------------------

    def temper(self, base: Explanation) -> Explanation:
        """Fit the base model again with its misfit taken for noise.

        Weighed against noise, a model that lacks something bends its parameters to any length, and hides what it
        lacks; weighed against its own misfit it keeps them near their priors.
        """
        self.problem.misfit_v = base.inflated_noise_v
        refitted = self.again(base, self.settings.refit_budget // 2)
        if not refitted.fit.fresh and self._low is None:
            # Scores and short fits stand on this Jacobian: after many updates it is no derivative any more.
            fit = refitted.fit
            refitted.fit = replace(fit, jacobian=slopes_at(self.residuals(base.effects), fit))
        return refitted

    def near_new(self) -> tuple[Fitter, Explanation] | None:
        """Records of many cycles up to where the cell as it was new has drifted far, and the base model there.

        What costs a fifth of the lithium is beyond what a score test, which is linear, can see, and a base model that
        is fitted to it is lost. None where no record drifts far.
        """
        if self.as_new is None:
            return None
        predictions = self.problem.predict((), self.space.at(self.as_new))
        cut = None if predictions is None else near_cycles(self.problem, self.problem.errors(predictions))
        if cut is None:
            return None
        near = Fitter(cut, self.space, self.settings, self._say)
        here = near.at((), self.space, self.as_new)
        if here is None:
            return None
        near.problem.misfit_v = here.inflated_noise_v
        fit = near.fit((), self.space, self.as_new, 1 + len(self.space))
        return None if fit is None else (near, near.explain((), fit))

    def taken_over(self, near: Problem, fits: Sequence[Fitted]) -> list[Explanation]:
        """Fits of this problem, of its first cycles, or of a cheaper model, as explanations of this problem.

        Those of first cycles are fitted on over more and more of them, and those that keep up, on all of them: far
        ahead of where it was fitted, a model runs empty in the wrong minute of every cycle, and slopes say nothing.
        """
        if near is self.problem and self._low is None:
            return [self.explain(effects, fit) for effects, fit in fits]
        for problem in longer(self.problem, near):
            stage = Fitter(problem, self.space, self.settings, self._say)
            running = stage._moved(fits)
            if running:
                problem.misfit_v = max(_NEAR_V, min(explanation.inflated_noise_v for explanation in running))
                running, _ = stage.race(running, _STAGE)
            fits = [(explanation.effects, explanation.fit) for explanation in running]
        return self._moved(fits)

    def _moved(self, fits: Sequence[Fitted]) -> list[Explanation]:
        """Fits of other problems on this one, not fitted yet; without those that cannot be simulated."""
        found = [self.at(effects, fit.space, fit.u) for effects, fit in fits]
        return [explanation for explanation in found if explanation is not None]

    def contest(self, base: Explanation, explanations: Sequence[Explanation]) -> list[Explanation]:
        """Fit explanations side by side until the best one has converged, and tell how each did; see `race`."""
        running, dropped = self.race(explanations, self.settings.refit_budget)
        for explanation in (*running, *dropped):
            self.tell(base, explanation)
        return [*running, *dropped]

    def race(self, explanations: Sequence[Explanation], budget: int) -> tuple[list[Explanation], list[Explanation]]:
        """Fit explanations side by side, from coarse to fine, as long as they keep up with the best one.

        At each level the misfit of the best one counts as noise, so that differences in cost are evidence. An
        explanation whose cost lags by more than `LAG`, and whose own slopes promise less than that lag, is dropped,
        and keeps the fit that it has. The last level, at which the best one is adequate or comes no nearer, gets the
        whole budget; those before it a third. Returns those that kept up, and the others.
        """
        running, dropped = list(explanations), []
        for level in range(_LEVELS):
            running.sort(key=lambda e: e.cost)
            best, before = running[0], self.problem.misfit_v
            # One that is near is weighed against the noise, as the base model was: only there can it prove adequate.
            left = best.inflated_noise_v if best.misfit_v > _NEAR_V else 0.0
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

    # --- judgement ------------------------------------------------------------------------------------------

    def explain(self, effects: tuple[Effect, ...], fit: Refit) -> Explanation:
        """A fit with its judgement: adequacy, errors on fitted and held-out data, estimates with intervals."""
        problem = self.problem
        predictions = problem.predict(effects, fit.candidate)
        assert predictions is not None, "a fit ends where it could be simulated"
        masks = list(zip(problem.observations, problem.errors(predictions), problem.fitted, strict=True))
        parts = [error[mask] for _, error, mask in masks]
        sigmas = [problem.sigma(observed)[mask] for observed, _, mask in masks]
        adequacy = judge(
            [part / sigma for part, sigma in zip(parts, sigmas, strict=True)],
            [observed.step[mask] for observed, _, mask in masks],
            fit.taken,
            freedom_of_deviations([subset(observed, mask) for observed, _, mask in masks], sigmas),
        )
        counts = np.concatenate([observed.count[mask] for observed, _, mask in masks])
        volts, sigma = np.concatenate(parts), np.concatenate(sigmas)
        rmse = _sample_rmse(volts, counts, self.problem.noise_v)
        held_rmse, held_errors = self._held(effects, fit)
        kelvin = _temperature_error(problem, predictions)
        explanation = Explanation(
            effects, fit, adequacy, rmse, held_rmse, volts, sigma, kelvin, held_errors=held_errors
        )
        systematic = problem.systematic() / problem.deviation()[:, None]
        explanation.estimates = estimates_of(effects, fit, explanation.dispersion(problem.misfit_v), systematic)
        if kelvin is not None:
            doubted = [effect for effect in effects if explanation.estimates[effect.key][0].holds_null]
            explanation.temperature_without_k = self._temperatures_without(doubted, effects, fit.candidate)
        return explanation

    def temperature_misfit(self, effects: Sequence[Effect], candidate: dict[str, float]) -> float:
        """What a measured temperature says against a candidate; 0 where none was measured."""
        if all(observed.temperature is None for observed in self.problem.observations):
            return 0.0
        predictions = self.problem.predict(effects, candidate)
        return 0.0 if predictions is None else temperature_misfit(_temperature_error(self.problem, predictions))

    def _temperatures_without(
        self, doubted: Sequence[Effect], effects: Sequence[Effect], candidate: dict[str, float]
    ) -> dict[str, float]:
        found = {}
        for effect in doubted:
            off = {effect.full_name(effect.strength): effect.strength.null}
            predictions = self.problem.predict(effects, candidate | off)
            kelvin = None if predictions is None else _temperature_error(self.problem, predictions)
            if kelvin is not None:
                found[effect.key] = kelvin
        return found

    def _held(self, effects: tuple[Effect, ...], fit: Refit) -> tuple[float, tuple[FloatArray, ...]]:
        """Error on all data that was not fitted, over single samples, and the errors of each hold-out record, V."""
        held = self.problem.held_out(effects, fit.candidate)
        if held is None:
            return float("inf"), ()
        errors = [error for _, error in held]
        counts = np.concatenate([observed.count for observed, _ in held])
        of_records = tuple(errors[len(errors) - len(self.problem.held_observations) :])
        return _sample_rmse(np.concatenate(errors), counts, self.problem.held_noise_v), of_records

    def tell(self, base: Explanation, explanation: Explanation, unless_told: bool = False) -> None:
        """Say in one line how an explanation did, beside the base model; ``unless_told`` only what is not said yet."""
        line = f"  {explanation.label}: {errors_in_words(explanation)}, {_against(base, explanation)}"
        if not (unless_told and self._told.get(explanation.label) == line):
            self._say(line)
        self._told[explanation.label] = line


def errors_in_words(explanation: Explanation) -> str:
    """Errors on the fitted and on the held-out data, and whether the fit has converged."""
    rms, held = 1e3 * explanation.rmse_v, 1e3 * explanation.held_rmse_v
    return f"{rms:.2f} mV, held out {held:.2f} mV" + " (not converged)" * (not explanation.settled)


def _against(base: Explanation, explanation: Explanation) -> str:
    """How likely an explanation is beside the base model: the difference in BIC, and why the error may differ."""
    margin = round(bic_difference(base, explanation))
    if margin == 0:
        return "BIC as that of the base model"
    farther = margin > 0 and round(1e3 * explanation.rmse_v, 2) > round(1e3 * base.rmse_v, 2)
    why = ", though the error is larger than the base model's: a few large errors count little in BIC" * farther
    return f"BIC {'better' if margin > 0 else 'worse'} by {abs(margin)}{why}"


def _temperature_error(problem: Problem, predictions: Sequence[Prediction]) -> float | None:
    """Error of the temperature over all fitted records that have one, K."""
    errors = list(problem.temperature_errors(predictions).values())
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2))) if errors else None


def _sample_rmse(errors: FloatArray, counts: FloatArray, noise: float) -> float:
    """Error over single samples, from errors of averages: averaging n samples hid noise^2 (1 - 1/n)."""
    squares = errors**2 + noise**2 * (1 - 1 / counts)
    return float(np.sqrt(np.sum(counts * squares) / np.sum(counts)))
