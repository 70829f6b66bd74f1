"""Posterior odds of the explanations that were fitted: a second opinion, stated beside the verdict of the rules."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..robust_loss import robust
from .discrepancy import Discrepancy, Errors
from .explanation import Explanation
from .findings import Findings
from .problem import Problem

Names = tuple[str, ...]

NAMED = 0.95
"""Probability from which the odds give a name: of what is said at that, one in twenty may be wrong."""

MOST = 0.5
"""Share of the base model's discrepancy that a named explanation may leave. Fits weigh neighbours as if they were
independent, so that the evidence of what leaves more is no better known than the discrepancy; and an effect of no
catalogue, too, has a nearest one in it."""

_DECADES = math.log(1e3)
"""Width of a strength's prior, which is flat in its logarithm: from what is just visible to a thousand times that."""


@dataclass(frozen=True)
class Weighed:
    """An explanation with its evidence.

    Attributes
    ----------
    names : tuple of str
        Names of its effects; empty for the base model.
    discrepancy : Discrepancy
        What it leaves beside noise.
    log_weight : float
        Logarithm of evidence times prior.
    at_bound : bool
        Whether a strength ran into its far bound.
    """

    names: Names
    discrepancy: Discrepancy
    log_weight: float
    at_bound: bool = False


@dataclass(frozen=True)
class Odds:
    """What the odds say.

    Attributes
    ----------
    tried : int
        Effects of the catalogue that the records can show; each is as likely beforehand as each other.
    explanations : tuple of Weighed
        The base model first, then the likeliest fit of each explanation, best first.
    probabilities : dict of tuple of str to float
        Posterior probability of each set of names; variants of an effect share a name.
    """

    tried: int
    explanations: tuple[Weighed, ...]
    probabilities: dict[Names, float] = field(init=False)

    def __post_init__(self) -> None:
        whole = float(np.logaddexp.reduce([one.log_weight for one in self.explanations]))
        found: dict[Names, float] = {}
        for one in self.explanations:
            found[one.names] = found.get(one.names, 0.0) + math.exp(one.log_weight - whole)
        object.__setattr__(self, "probabilities", found)

    @property
    def best(self) -> Weighed:
        """The likeliest explanation; the base model where none was fitted."""
        return self.explanations[min(1, len(self.explanations) - 1)]

    @property
    def left(self) -> float:
        """Share of the base model's discrepancy that the likeliest explanation leaves."""
        before = self.explanations[0].discrepancy.scale_v
        return self.best.discrepancy.scale_v / before if before else 0.0

    @property
    def verdict(self) -> str:
        """As the rules say it; the base model's noise, bounds and `MOST` come before any probability."""
        base, best = self.explanations[0], self.best
        if base.discrepancy.scale_v == 0.0:
            return "no-missing-effect"
        nothing, found = self.probabilities[()], self.probabilities[best.names]
        if best is base or best.at_bound or self.left > MOST or nothing > (1 - NAMED) * (nothing + found):
            return "unexplained"
        return "ambiguous" if self.rivals else "effect-found"

    @property
    def names(self) -> Names:
        """What the odds name, or hold for likeliest of several."""
        return self.best.names if self.verdict in ("effect-found", "ambiguous") else ()

    @property
    def rivals(self) -> list[Names]:
        """The likeliest other names that it takes, with the best ones, to come to `NAMED`."""
        told, found = self.probability(self.best.names), []
        others = {names: share for names, share in self.probabilities.items() if not set(names) >= set(self.best.names)}
        for names in sorted(others, key=lambda names: -others[names]):
            if told >= NAMED:
                break
            found.append(names)
            told += others[names]
        return found

    def probability(self, names: Names) -> float:
        """Probability that some effects are there: alone, or with others."""
        return min(1.0, sum(share for found, share in self.probabilities.items() if set(found) >= set(names)))

    def statement(self, names: Names) -> str:
        """The odds of what the rules name, in one sentence; empty where they name nothing."""
        if not names:
            return ""
        if self.left > MOST:
            return f"no odds are stated: the likeliest explanation leaves {self.left:.0%} of the discrepancy"
        return f"probability {_digits(self.probability(names))} among the {self.tried} candidates tried"


def weigh(problem: Problem, findings: Findings) -> Odds:
    """The odds of everything that was fitted in a discovery.

    Temperature, which no fit is shown, is one more observation. What data that were not fitted say is no part of it.
    """
    tried = sum(not nomination.lacks for nomination in findings.nominations)
    base = max((_weighed(problem, one, tried) for one in _distinct(findings)), key=lambda one: one.log_weight)
    best: dict[str, Weighed] = {}
    for explanation in findings.explanations:
        found = _weighed(problem, explanation, tried)
        if explanation.label not in best or best[explanation.label].log_weight < found.log_weight:
            best[explanation.label] = found
    return Odds(tried, (base, *sorted(best.values(), key=lambda one: -one.log_weight)))


def _distinct(findings: Findings) -> list[Explanation]:
    """The fits of the base model."""
    return list(dict.fromkeys((findings.base, findings.nearest_base)))


def _weighed(problem: Problem, explanation: Explanation, tried: int) -> Weighed:
    errors = _errors(problem, explanation)
    discrepancy, log_evidence = errors.likeliest()
    deviations = np.sqrt(np.diag(errors.covariance(discrepancy)))
    fit = explanation.fit
    prior = 0.0
    for effect in explanation.effects:
        place = fit.space.names.index(effect.full_name(effect.strength))
        # A strength's coordinate is -1 at its null; what is smaller than its own deviation is not visible.
        strength = max(abs(float(fit.u[place]) + 1.0), float(deviations[place]))
        prior -= math.log(_DECADES * strength) + math.log(max(tried, 1))
    weight = log_evidence + prior - 0.5 * explanation.temperature_misfit
    at_bound = any(explanation.estimates[effect.key][0].at_bound for effect in explanation.effects)
    return Weighed(explanation.names, discrepancy, weight, at_bound)


def _errors(problem: Problem, explanation: Explanation) -> Errors:
    """What an explanation leaves, in volts and without any misfit that its fit counted as noise."""
    fit = explanation.fit
    deviation = problem.deviation() if fit.deviation is None else fit.deviation
    added = sum(len(effect.parameters) for effect in explanation.effects)
    return Errors(
        _times(problem),
        robust(explanation.errors),
        explanation.sigma,
        fit.jacobian * deviation[:, None],
        fit.u,
        fit.space.prior_weights,
        len(fit.space) - added,
    )


def _times(problem: Problem) -> Sequence[np.ndarray]:
    return [observed.time[mask] for observed, mask in zip(problem.observations, problem.fitted, strict=True)]


def _digits(probability: float) -> str:
    """With two digits, and never a 1 that is not meant."""
    return f"{probability:.2f}" if probability < 0.995 else "above 0.99"
