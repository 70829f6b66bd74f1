"""The workflow: calibrate, localise, test, nominate, screen, confirm, and say what is missing, or that nothing is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..effect import Effect, Evidence
from ..trajectory import FloatArray
from .adequacy import Adequacy, judge
from .axes import Axis, candidate_of, effect_axes
from .explanation import Explanation, estimates_of
from .problem import Problem
from .refit import Refit, refit
from .rules import believable, bic_difference, rivals
from .score import Score, score_effect

Listener = Callable[[str], None]

_COARSE_V = 0.03
"""Misfit with which the base fit begins, V."""

_NEAR_V = 2e-3
"""A typical error below which a fit is near enough to be weighed against the noise, V."""

_GOOD_START = 3.0
"""Mean residual, in deviations, from which a fit finds its way."""

_HOPELESS = 30.0
"""A short refit this many times worse than an adequate explanation is not worth a long one."""


@dataclass(frozen=True)
class Settings:
    """How hard to look.

    Attributes
    ----------
    max_effects : int
        Effects in one explanation at most.
    screened : int
        Effects that get a short refit.
    confirmed : int
        Effects that are fitted until converged.
    base_budget, refit_budget : int
        Simulations of the base fit and of each confirmation at most.
    settled : int
        Explanations that are fitted on with their own misfit.
    seed : int
        For the second start of the base fit.
    """

    max_effects: int = 2
    screened: int = 6
    confirmed: int = 3
    base_budget: int = 110
    refit_budget: int = 90
    settled: int = 2
    seed: int = 0


@dataclass(eq=False)
class Nomination:
    """An effect of the catalogue and how far it came.

    Attributes
    ----------
    effect : Effect
        The effect.
    lacks : str
        Why it was not considered; empty if it was.
    score : Score or None
        Its score test at the base fit.
    mark : ndarray or None
        Derivative of the weighted residual by its strength, per probe.
    screened_cost : float or None
        Sum of squares after a short refit.
    """

    effect: Effect
    lacks: str = ""
    score: Score | None = None
    mark: FloatArray | None = None
    screened: Refit | None = None


@dataclass(eq=False)
class Findings:
    """What the engine found.

    Attributes
    ----------
    verdict : str
        ``"no-missing-effect"``, ``"effect-found"``, ``"ambiguous"`` or ``"unexplained"``.
    base, best : Explanation
        The base model and the best explanation (the base model itself if nothing is missing).
    rivals : list of Explanation
        What cannot be told from the best.
    explanations : list of Explanation
        All that were fitted until converged, best first.
    nominations : list of Nomination
        Every effect of the catalogue.
    reason : str
        Why the verdict is what it is.
    mesh_v : float
        Size of the mesh correction, V.
    """

    verdict: str
    base: Explanation
    best: Explanation
    rivals: list[Explanation] = field(default_factory=list)
    explanations: list[Explanation] = field(default_factory=list)
    nominations: list[Nomination] = field(default_factory=list)
    reason: str = ""
    mesh_v: float = 0.0


class Engine:
    """Runs a discovery on a problem.

    Parameters
    ----------
    problem : Problem
        Records and laboratory.
    axes : tuple of Axis
        The uncertain parameters of the base model.
    catalogue : sequence of Effect
        What may be missing.
    evidence : Evidence
        What the records can show.
    settings : Settings
        How hard to look.
    listener : callable
        Told in one line what is being done.
    preferred : callable, optional
        Given the scored nominations, returns keys of effects to screen in any case (a language model's ranking).
    """

    def __init__(
        self,
        problem: Problem,
        axes: tuple[Axis, ...],
        catalogue: Sequence[Effect],
        evidence: Evidence,
        settings: Settings | None = None,
        listener: Listener = lambda text: None,
        preferred: Callable[[Explanation, Sequence[Nomination]], Sequence[str]] | None = None,
    ) -> None:
        self.problem = problem
        self.axes = axes
        self.catalogue = tuple(catalogue)
        self.evidence = evidence
        self.settings = settings or Settings()
        self._say = listener
        self._preferred = preferred

    # --- the workflow ---------------------------------------------------------------------------------------

    def run(self) -> Findings:
        """Carry out the whole workflow."""
        base, mesh_v = self.calibrate()
        if base.adequacy.adequate:
            return Findings("no-missing-effect", base, base, reason=_why_adequate(base), mesh_v=mesh_v)
        self._say(f"a discrepancy of {1e3 * base.adequacy.structured_v:.2f} mV remains; nominating effects")
        calm = self.temper(base) if self.problem.misfit_v == 0.0 else base
        if calm.rmse_v < base.rmse_v:
            base = calm
        nominations = self.nominate(calm)
        explanations = self._sorted(self.untemper(base, self.confirm(calm, nominations)))
        if self.settings.max_effects > 1 and explanations and not explanations[0].adequacy.adequate:
            self.problem.misfit_v = explanations[0].misfit_v
            pairs = self.pair(base, [self._again(e) for e in explanations[:2]], nominations)
            explanations = self._sorted(explanations + self.untemper(base, pairs))
        findings = self.decide(base, explanations)
        findings.nominations, findings.mesh_v = nominations, mesh_v
        return findings

    def calibrate(self) -> tuple[Explanation, float]:
        """Fit the base model until converged, correct for the mesh, and fit again."""
        self._say("calibrating the base model")
        settings = self.settings
        start = np.zeros(len(self.axes))
        residual = self._residual(())
        # From coarse to fine: each fit counts as noise what the one before it could not explain, and noise alone is
        # reached only by a model that comes near it. Started at the finest, a fit loses itself on the steep parts.
        self.problem.misfit_v = _COARSE_V
        fit = self._fit_from_somewhere(residual, start)
        for _ in range(3):
            left = self._explanation((), fit, None).misfit_v
            left = left if left > _NEAR_V else 0.0
            if left > 0.7 * self.problem.misfit_v:
                break
            self.problem.misfit_v = left
            fit = refit(residual, self.axes, fit.u, None, settings.base_budget // 2, 1e-2) or fit
            if left == 0.0:
                break
        mesh_v = self.problem.correct_mesh((), fit.candidate)
        self._say(f"mesh and tolerances: {1e3 * mesh_v:.2f} mV, corrected")
        fit = refit(residual, self.axes, fit.u, None, settings.base_budget) or fit
        base = self._explanation((), fit, None)
        if not base.adequacy.adequate:
            # A poor fit may be a poor start: try another before calling it missing physics.
            rng = np.random.default_rng(settings.seed)
            other_start = np.array(
                [rng.normal() if axis.prior else u for axis, u in zip(self.axes, fit.u, strict=True)]
            )
            other = refit(residual, self.axes, other_start, None, settings.base_budget // 2)
            if other is not None and other.cost < 0.98 * fit.cost:
                fit = refit(residual, self.axes, other.u, None, settings.base_budget) or other
                base = self._explanation((), fit, None)
        self._say(f"base model: {1e3 * base.rmse_v:.2f} mV" + " (not converged)" * (not fit.converged))
        return base, mesh_v

    def temper(self, base: Explanation) -> Explanation:
        """Fit the base model again with its misfit taken for noise.

        Weighed against noise, a model that lacks something bends its parameters to any length, and hides what it
        lacks; weighed against its own misfit it keeps to what is believed of them.
        """
        self.problem.misfit_v = base.misfit_v
        return self._again(base, fresh=True)

    def untemper(self, base: Explanation, explanations: Sequence[Explanation]) -> list[Explanation]:
        """Fit the best explanations with their own misfit instead of the base model's; the others stay as they are."""
        ranked = sorted(explanations, key=lambda e: e.fit.cost)
        result = ranked[self.settings.settled :]
        for explanation in ranked[: self.settings.settled]:
            current = explanation
            for _ in range(3):
                before = self.problem.misfit_v
                self.problem.misfit_v = min(current.misfit_v, before)
                current = self._again(current, fresh=False)
                if self.problem.misfit_v > 0.5 * before or current.adequacy.adequate:
                    break
            self._tell(base, current)
            result.append(current)
            self.problem.misfit_v = base.misfit_v
        return result

    def _again(self, explanation: Explanation, fresh: bool = False) -> Explanation:
        """The same explanation, fitted on from where it is with the present misfit."""
        fit = explanation.fit
        budget = self.settings.refit_budget if fresh else self.settings.refit_budget // 2
        again = refit(self._residual(explanation.effects), fit.axes, fit.u, None, budget)
        return explanation if again is None else self._explanation(explanation.effects, again, explanation.score)

    def _fit_from_somewhere(
        self, residual: Callable[[dict[str, float]], FloatArray | None], start: FloatArray
    ) -> Refit:
        # A cell that is too small, or too slow for its current, is empty before its record ends, and a fit that
        # starts there is soon lost: start from the best of some roomier, faster and less full ones.
        best: tuple[float, FloatArray] | None = None
        for ease in (0.0, 0.5, 1.0, 1.5):
            for soc_shift in (0.0, 3.0, -4.0):
                shifted = start + np.array([ease if axis.prior else soc_shift for axis in self.axes])
                here = residual(candidate_of(self.axes, shifted))
                if here is not None and (best is None or float(here @ here) < best[0]):
                    best = (float(here @ here), shifted)
            if best is not None and best[0] < _GOOD_START**2 * len(self.problem.fitted[0]):
                break
        if best is not None:
            fit = refit(residual, self.axes, best[1], None, self.settings.base_budget, 2e-2)
            if fit is not None:
                return fit
        from ..errors import BsaError

        raise BsaError(
            "the base model cannot follow the record's current from any initial state of charge.",
            "check the sign of the current and the capacity of the parameter set.",
        )

    def nominate(self, base: Explanation) -> list[Nomination]:
        """Score every effect at the base fit."""
        nominations = []
        for effect in self.catalogue:
            reason = effect.lacks(self.evidence) if effect.lacks is not None else ""
            nomination = Nomination(effect, reason)
            if not reason:
                nomination.mark = self.mark(base, effect)
                if nomination.mark is None:
                    nomination.lacks = "could not be simulated at the base fit"
                else:
                    nomination.score = self.score(base, effect, nomination.mark)
            nominations.append(nomination)
        nominations.sort(key=lambda n: -(n.score.gain if n.score else -1.0))
        for n in nominations[:6]:
            if n.score:
                self._say(
                    f"  {n.effect.key}: z {n.score.z:+.1f}, promises {n.score.gain / max(base.fit.chi2, 1.0):.0%}"
                )
        return nominations

    def mark(self, explanation: Explanation, effect: Effect) -> FloatArray | None:
        """Derivative of the weighted residual by an effect's strength (per probe), given an explanation.

        Against the effect's own null rather than the base model: an option may change the approximation a
        little even at strength zero, and that is not the effect.
        """
        effects = (*explanation.effects, effect)
        off = explanation.fit.candidate | {effect.full_name(p): p.null for p in effect.parameters}
        on = explanation.fit.candidate | {effect.full_name(p): p.probe for p in effect.parameters}
        for p in effect.parameters[1:]:
            off[effect.full_name(p)] = p.probe
        dark = self.problem.residual(effects, off)
        lit = self.problem.residual(effects, on)
        if lit is None:
            return None
        return lit - (dark if dark is not None else explanation.fit.residual)

    def score(self, explanation: Explanation, effect: Effect, mark: FloatArray) -> Score:
        """Score an effect on what an explanation leaves."""
        strength = effect.strength
        unit = strength.probe - strength.null
        ends = sorted(((strength.lower - strength.null) / unit, (strength.upper - strength.null) / unit))
        fit = explanation.fit
        return score_effect(fit.residual, fit.jacobian, mark, fit.axes, fit.u, (ends[0], ends[1]))

    def confirm(self, base: Explanation, nominations: Sequence[Nomination]) -> list[Explanation]:
        """Screen with short refits, then fit the shortlist until converged."""
        keys = list(self._preferred(base, nominations)) if self._preferred is not None else []
        scored = [n for n in nominations if n.score is not None and n.score.gain > 0]
        chosen = scored[: self.settings.screened]
        chosen += [n for n in scored[self.settings.screened :] if n.effect.key in keys]
        self._say(f"screening {len(chosen)} effects")
        for nomination in chosen:
            assert nomination.score is not None
            nomination.screened = self._short_refit(base, nomination)
        alive = [n for n in chosen if n.screened is not None]
        alive.sort(key=lambda n: n.screened.cost if n.screened else np.inf)
        result: list[Explanation] = []
        for nomination in alive[: self.settings.confirmed]:
            assert nomination.screened is not None
            if result and result[0].adequacy.adequate and nomination.screened.cost > _HOPELESS * result[0].fit.cost:
                break
            explanation = self._full_refit((nomination.effect,), nomination.screened, nomination.score, result)
            result.append(explanation)
            result.sort(key=lambda e: e.fit.cost)
            self._tell(base, explanation)
        return result

    def pair(
        self, base: Explanation, singles: Sequence[Explanation], nominations: Sequence[Nomination]
    ) -> list[Explanation]:
        """Add a second effect to the best single ones: re-score on what they leave, screen, confirm."""
        found: dict[tuple[str, ...], Explanation] = {}
        usable = [n for n in nominations if n.mark is not None]
        for first in list(singles)[:2]:
            scored = []
            for nomination in usable:
                effect = nomination.effect
                if effect.name in first.names or not _compatible(first.effects[0], effect):
                    continue
                mark = self.mark(first, effect)
                if mark is None:
                    continue
                score = self.score(first, effect, mark)
                if score.gain > 0:
                    scored.append(Nomination(effect, "", score, mark))
            scored.sort(key=lambda n: -(n.score.gain if n.score else 0.0))
            screened = []
            for nomination in scored[:4]:
                key = tuple(sorted((first.effects[0].key, nomination.effect.key)))
                if key in found:
                    continue
                short = self._short_refit(first, nomination)
                if short is not None:
                    screened.append((short.cost, nomination, short))
            screened.sort(key=lambda row: row[0])
            for _, nomination, short in screened[:2]:
                effects = (first.effects[0], nomination.effect)
                explanation = self._full_refit(effects, short, nomination.score, list(found.values()) or singles)
                found[tuple(sorted(effect.key for effect in effects))] = explanation
                self._tell(base, explanation)
        return list(found.values())

    def decide(self, base: Explanation, explanations: Sequence[Explanation]) -> Findings:
        """Apply the rules."""
        held_noise = self._held_noise()
        noise = self._noise()
        ranked = list(explanations)
        if not ranked:
            return Findings("unexplained", base, base, reason="no effect of the catalogue points the right way")
        objections = {id(e): believable(base, e, noise, held_noise) for e in ranked}
        believed = [e for e in ranked if not objections[id(e)]]
        # A pair must beat each of its members clearly, or the simpler one stands.
        believed = [e for e in believed if not self._needless(e, ranked)]
        if not believed:
            reason = f"{ranked[0].label}: {objections[id(ranked[0])]}"
            return Findings("unexplained", base, ranked[0], explanations=ranked, reason=reason)
        best = believed[0]
        equal = rivals(best, [e for e in ranked if e is not best and not self._needless(e, ranked)])
        verdict = "ambiguous" if equal else "effect-found"
        margin = bic_difference(base, best)
        reason = f"{best.label} beats the base model by {margin:.0f} in BIC"
        if equal:
            reason += f"; not to be told from {', '.join(e.label for e in equal)}"
        return Findings(verdict, base, best, equal, ranked, reason=reason)

    # --- steps ----------------------------------------------------------------------------------------------

    def _residual(self, effects: tuple[Effect, ...]) -> Callable[[dict[str, float]], FloatArray | None]:
        return lambda candidate: self.problem.residual(effects, candidate)

    def _short_refit(self, before: Explanation, nomination: Nomination) -> Refit | None:
        """A few Broyden steps from a known explanation, with its Jacobian and the effect's mark."""
        assert nomination.score is not None
        assert nomination.mark is not None
        effects = (*before.effects, nomination.effect)
        axes = (*before.fit.axes, *effect_axes((nomination.effect,)))
        own = np.zeros(len(axes) - len(before.fit.axes))
        # The strength's coordinate is 0 at the probe and -1 at the null.
        own[0] = np.clip(nomination.score.amplitude, -4.0, 4.0) - 1.0
        start = np.concatenate([before.fit.u, own])
        columns = np.column_stack([before.fit.jacobian, nomination.mark, *([0 * nomination.mark] * (len(own) - 1))])
        best: Refit | None = None
        gentle = own.copy()
        gentle[0] = np.sign(nomination.score.amplitude) * 0.5 - 1.0 if nomination.score.amplitude else -1.0
        for attempt in (start, np.concatenate([before.fit.u, gentle])):
            result = refit(self._residual(effects), axes, attempt, columns, 12)
            if result is not None and (best is None or result.cost < best.cost):
                best = result
            if best is not None and best.cost < 0.7 * before.fit.cost:
                break
        return best

    def _full_refit(
        self, effects: tuple[Effect, ...], start: Refit, score: Score | None, others: Sequence[Explanation]
    ) -> Explanation:
        """Fit until converged; one that lags far behind another after half its budget gets no more."""
        residual = self._residual(effects)
        half = max(self.settings.refit_budget // 2, 3 * len(start.axes))
        fit = refit(residual, start.axes, start.u, None, half) or start
        ahead = min((other.fit.cost for other in others), default=np.inf)
        if not fit.converged and fit.cost < 4.0 * ahead:
            fit = refit(residual, fit.axes, fit.u, fit.jacobian, half) or fit
        return self._explanation(effects, fit, score)

    def _explanation(self, effects: tuple[Effect, ...], fit: Refit, score: Score | None) -> Explanation:
        problem = self.problem
        predictions = problem.predict(effects, fit.candidate)
        assert predictions is not None, "a fit ends where it could be simulated"
        raw = problem.weighted(problem.errors(predictions))
        parts, sigmas, groups = [], [], []
        start = 0
        for observed, mask in zip(problem.observations, problem.fitted, strict=True):
            size = int(np.count_nonzero(mask))
            parts.append(raw[start : start + size])
            sigmas.append(problem.sigma(observed)[mask])
            groups.append(observed.step[mask])
            start += size
        adequacy = judge(parts, sigmas, groups, len(fit.axes))
        counts = np.concatenate([o.count[m] for o, m in zip(problem.observations, problem.fitted, strict=True)])
        sigma = np.concatenate(sigmas)
        volts = raw * sigma
        rmse = self._sample_rmse(volts, counts, self._noise())
        held_rmse, held_chi2 = self._held(effects, fit)
        explanation = Explanation(effects, fit, adequacy, rmse, held_rmse, held_chi2, volts, sigma, score)
        explanation.estimates = estimates_of(effects, fit, explanation.dispersion(problem.misfit_v))
        return explanation

    def _held(self, effects: tuple[Effect, ...], fit: Refit) -> tuple[float, float]:
        held = self.problem.held_out(effects, fit.candidate)
        if held is None:
            return float("inf"), float("inf")
        errors = np.concatenate([error for _, error in held])
        counts = np.concatenate([observed.count for observed, _ in held])
        sigma = np.concatenate([observed.sigma for observed, _ in held])
        return self._sample_rmse(errors, counts, self._held_noise()), float(np.mean((errors / sigma) ** 2))

    @staticmethod
    def _sample_rmse(errors: FloatArray, counts: FloatArray, noise: float) -> float:
        """Error over single samples, from errors of averages: averaging n samples hid noise^2 (1 - 1/n)."""
        squares = errors**2 + noise**2 * (1 - 1 / counts)
        return float(np.sqrt(np.sum(counts * squares) / np.sum(counts)))

    def _noise(self) -> float:
        return float(np.sqrt(np.mean([observed.noise**2 for observed in self.problem.observations])))

    def _held_noise(self) -> float:
        held = self.problem.held_observations or self.problem.observations
        return float(np.sqrt(np.mean([observed.noise**2 for observed in held])))

    def _sorted(self, explanations: Sequence[Explanation]) -> list[Explanation]:
        if not explanations:
            return []
        # All on one scale: the misfit of the one that comes nearest to the data.
        nearest = min(explanations, key=lambda e: e.misfit_v)
        misfit = nearest.misfit_v
        c, n = nearest.dispersion(misfit), float(np.log(len(nearest.errors)))
        return sorted(explanations, key=lambda e: e.chi2(misfit) / c + e.fit.belief + n * len(e.fit.axes))

    def _needless(self, explanation: Explanation, others: Sequence[Explanation]) -> bool:
        if len(explanation.effects) < 2:
            return False
        for other in others:
            if len(other.effects) < len(explanation.effects) and set(other.names) < set(explanation.names):
                if bic_difference(other, explanation) <= 10.0:
                    return True
                if other.adequacy.adequate:
                    return True
        return False

    def _tell(self, base: Explanation, explanation: Explanation) -> None:
        margin = bic_difference(base, explanation)
        rms, held = 1e3 * explanation.rmse_v, 1e3 * explanation.held_rmse_v
        doubt = " (not converged)" * (not explanation.fit.converged)
        self._say(f"  {explanation.label}: {rms:.2f} mV, held out {held:.2f} mV, BIC {margin:+.0f}{doubt}")


def _compatible(one: Effect, other: Effect) -> bool:
    """Whether two effects leave each other's options alone; the simulator has the last word."""
    return one.name != other.name


def _why_adequate(base: Explanation) -> str:
    found: Adequacy = base.adequacy
    return f"noise explains the residual (size p = {found.p_size:.2g}, structure p = {found.p_structure:.2g})"
