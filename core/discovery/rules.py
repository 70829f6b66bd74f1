"""The rules by which an explanation is accepted, and two are called indistinguishable; and the verdict they give."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..inference.adequacy import FALSE_ALARM
from .explanation import CLEAR_K, TEMPERATURE_DEVIATION_K, Explanation, clearly_nearer, temperature_misfit
from .findings import Findings, Gap


def bic(explanation: Explanation, scale: Explanation, temperature_k: float = TEMPERATURE_DEVIATION_K) -> float:
    r"""BIC of an explanation by quasi-likelihood, on the scale that another one sets.

    .. math:: S / c + W + B + k \ln n

    with ``S`` the sum of squares in which the misfit of ``scale`` counts as noise, and ``c`` its dispersion, so that
    neighbours which repeat one another, and what neither explains, do not count as evidence (Burnham and Anderson
    2002, doi:10.1007/b97636, section 2.5); ``W`` the squared error of the temperature, which no fit is shown, as one
    observation with the deviation ``temperature_k``; ``B`` the cost of the priors; ``k`` the number of parameters and
    ``n`` that of observations.
    """
    misfit = scale.misfit_v
    squares = explanation.chi2(misfit) / scale.dispersion(misfit)
    size = len(explanation.fit.space) * float(np.log(len(scale.errors)))
    kelvin = temperature_misfit(explanation.temperature_rms_k, temperature_k)
    return squares + kelvin + explanation.fit.prior_cost + size


def bic_difference(worse: Explanation, better: Explanation, temperature_k: float = TEMPERATURE_DEVIATION_K) -> float:
    """BIC of one explanation minus that of another, on the scale of the better one."""
    return bic(worse, better, temperature_k) - bic(better, better, temperature_k)


def ranked(explanations: Sequence[Explanation]) -> list[Explanation]:
    """Best first, all on one scale: the misfit of the one that comes nearest to the data."""
    if not explanations:
        return []
    nearest = min(explanations, key=lambda one: one.misfit_v)
    return sorted(explanations, key=lambda one: bic(one, nearest))


def closed(before_v: float, after_v: float, floor_v: float) -> float:
    """Share of the squared misfit beyond a floor that is gone: ``1 - (after^2 - floor^2) / (before^2 - floor^2)``.

    The floor is the noise, and what the base model is known to lack of the cell; see `Gap.floor_v`. Not a number where
    the error was no larger than that before: there is nothing of which it would be a share.
    """
    excess = before_v**2 - floor_v**2
    return math.nan if excess <= 0 else 1.0 - max(after_v**2 - floor_v**2, 0.0) / excess


_FARTHER = "comes no nearer to the records than {}"


@dataclass(frozen=True)
class Rules:
    """The rules with their constants, all that decide between the verdicts."""

    false_alarm: float = FALSE_ALARM  # Probability that noise alone is taken for a discrepancy.
    # Difference in BIC from which one explanation is clearly better than another (Kass and Raftery 1995).
    clear_bic: float = 10.0
    # Times that difference which no further gain of an unfinished fit, and no prediction of other data, outweighs.
    far_ahead: float = 10.0
    # Share by which an error on data not fitted must be smaller to be clearly smaller.
    held_margin: float = 0.1
    # Share of the excess variance that a named explanation may leave, on the fitted data and on data not fitted alike:
    # the error beyond noise is halved, as that of a temperature must be. What leaves more is a partial explanation, and
    # another effect may stand behind it.
    left_over: float = 0.25
    # How well a model's temperature can be expected to agree with a sensor, K.
    temperature_k: float = TEMPERATURE_DEVIATION_K
    # What a temperature's error must be smaller by, besides being half as large, to be clearly smaller, K.
    clear_k: float = CLEAR_K
    # base_words, held_words: What a reason calls the model that lacks all effects, and what is never fitted.
    base_words: str = "the base model"
    held_words: str = "data not fitted"

    def explains_all(self, found: Explanation) -> bool:
        """Whether an explanation leaves noise only."""
        return found.adequacy.noise_only(self.false_alarm)

    def noise_suffices(self, gap: Gap, explanations: Sequence[Explanation]) -> bool:
        """Whether noise explains what the base model leaves, and none of the explanations is far ahead nonetheless.

        Tests of noise ask whether the residual is too large in all. A comparison with one effect, which says where the
        residual should be and of what sign, tells smaller discrepancies.
        """
        return self.explains_all(gap.base) and not any(
            self.behind(gap.base, e) > self.far_ahead and not self.objection_to(e, gap) for e in explanations
        )

    def behind(self, worse: Explanation, better: Explanation) -> float:
        """By how many clear differences in BIC one explanation is worse than another."""
        return bic_difference(worse, better, self.temperature_k) / self.clear_bic

    def predicts_temperature(self, better: Explanation, worse: Explanation) -> bool:
        """Whether one explanation predicts the measured temperature clearly better than another."""
        return clearly_nearer(better.temperature_rms_k, worse.temperature_rms_k, self.clear_k)

    def predicts_held(self, better: Explanation, worse: Explanation) -> bool:
        """Whether one explanation predicts the data not fitted clearly better than another."""
        return better.held_rmse_v < (1.0 - self.held_margin) * worse.held_rmse_v

    def objection_to(self, found: Explanation, gap: Gap) -> str:
        """Why an explanation may not be named; empty if it may."""
        base, margin = gap.base, self.behind(gap.base, found)
        if margin <= 1.0:
            return f"does not beat {self.base_words} by {self.clear_bic:g} in BIC"
        if not found.excludes_null(self.clear_k):
            return "a strength's 95 % interval contains its null value, or it ran into a bound"
        if not (found.settled or self.explains_all(found) or margin > self.far_ahead):
            return "its fit did not converge"
        if len(found.effects) > 1 and not self.explains_all(found):
            return f"{_left_in_words(found, gap)}, and two effects are named only where they leave noise alone"
        # A base model with parameters far from their priors may come as near to the voltage; BIC counts the priors.
        # A temperature predicted clearly better, which no fit was shown, then stands for the gap that it hides.
        warm = self.predicts_temperature(found, base)
        if not warm and (objection := self.leaves_too_much(found, gap)):
            return objection
        # A measured temperature is data not fitted too: where it tells, the voltage has to be predicted about as well.
        # So it has where noise alone is left by an explanation that is far ahead: what both mispredict tells nothing.
        told = warm or (self.explains_all(found) and margin > self.far_ahead)
        if not found.held_rmse_v < base.held_rmse_v / (1.0 - self.held_margin if told else 1.0):
            return f"does not predict {self.held_words} better than {self.base_words}"
        # A few large errors count little in BIC, so that the error may grow while the likelihood improves.
        return _FARTHER.format(self.base_words) * (margin <= self.far_ahead and found.rmse_v > gap.nearest.rmse_v)

    def leaves_too_much(self, found: Explanation, gap: Gap) -> str:
        """Why an explanation is a partial one at most, for what it leaves; empty if it is not."""
        if self.explains_all(found):
            return ""
        share = closed(gap.nearest.rmse_v, found.rmse_v, gap.floor_v)
        if share < 0.0:
            return _FARTHER.format(self.base_words)
        if share < 1.0 - self.left_over:
            return f"explains {share:.0%} of the squared misfit only, and {_left_in_words(found, gap)}"
        held, shown = gap.base.held_rmse_v, gap.base.held_rmse_v > (1.0 + self.held_margin) * gap.held_floor_v
        share = closed(held, found.held_rmse_v, gap.held_floor_v)
        little = shown and share < 1.0 - self.left_over
        return f"explains {share:.0%} of the squared misfit in {self.held_words} only" * little

    def rivals(self, best: Explanation, others: Sequence[Explanation]) -> list[Explanation]:
        """Explanations with other names that cannot be told from the best one.

        Either their BIC is clearly no worse, or not far behind and they predict the data not fitted clearly better, or
        their fit has not converged, which is no evidence against them. One that predicts a measured temperature, or the
        data not fitted, clearly worse is no rival; nor is the best one with one effect more.
        """
        found = []
        for other in others:
            extended = set(best.names) <= set(other.names)
            if extended or not other.excludes_null(self.clear_k):
                continue
            if self.predicts_temperature(best, other) or self.predicts_held(best, other):
                continue
            predicts_better = self.predicts_held(other, best) and not self.explains_all(best)
            unfinished = len(other.effects) <= len(best.effects) and not (other.settled or self.explains_all(other))
            if self.behind(other, best) <= (self.far_ahead if predicts_better or unfinished else 1.0):
                found.append(other)
        return found

    def needless(self, explanation: Explanation, others: Sequence[Explanation]) -> bool:
        """Whether some of its effects explain as much as all of them, or predict data not fitted as well."""
        parts = [other for other in others if set(other.names) < set(explanation.names)]
        return any(
            self.explains_all(part)
            or self.behind(part, explanation) <= 1.0
            or not self.predicts_held(explanation, part)
            for part in parts
        )

    def decide(self, gap: Gap, best_first: Sequence[Explanation]) -> Findings:
        """The verdict on explanations that are sorted, the best first."""
        base, explanations = gap.base, list(best_first)
        if self.noise_suffices(gap, explanations):
            of = base.adequacy
            reason = f"noise explains the residual (size p = {of.p_size:.2g}, structure p = {of.p_structure:.2g})"
            gap = replace(gap, nearest=base)
            return Findings("no-missing-effect", gap, base, explanations=explanations, reason=reason)
        if not explanations:
            return Findings("unexplained", gap, base, reason="no effect that was tried points the right way")
        # A pair must beat each of its members clearly, on data not fitted too, or the simpler one stands.
        needed = [e for e in explanations if not self.needless(e, explanations)]
        accepted = [e for e in needed if not self.objection_to(e, gap)]
        if not accepted:
            # What is no better than the base model, or no nearer to the records, explains no part of the discrepancy.
            partial = [e for e in needed if self.behind(base, e) > 0 and e.rmse_v < gap.nearest.rmse_v]
            first = (partial or needed)[0]
            reason = f"{first.label}: {self.objection_to(first, gap)}"
            nearest = first if partial else gap.nearest
            return Findings("unexplained", gap, nearest, explanations=explanations, reason=reason)
        best = accepted[0]
        for other in accepted[1:]:
            # Within what BIC can tell, the temperature that no fit was shown decides.
            if self.behind(other, best) <= 1.0 and self.predicts_temperature(other, best):
                best = other
        equal = self.rivals(best, [e for e in needed if e is not best])
        reason = f"{best.label} beats {self.base_words} by {bic_difference(base, best):.0f} in BIC"
        if not self.explains_all(best):
            reason += f" and {_left_in_words(best, gap)}: something else may be missing too"
            reason += ", and the values found may compensate for it"
        if not (best.settled or self.explains_all(best)):
            reason += "; its fit did not converge, and its intervals may be too narrow"
        if equal:
            reason += f"; not to be told from {', '.join(e.label for e in equal)}"
        return Findings("ambiguous" if equal else "effect-found", gap, best, equal, explanations, reason=reason)


def _left_in_words(found: Explanation, gap: Gap) -> str:
    if found.rmse_v <= gap.noise_v:
        return "leaves errors of the size of the noise that are not random"
    return f"leaves {found.rmse_v / gap.noise_v:.1f} times the noise"


RULES = Rules()
"""The rules that are used."""
