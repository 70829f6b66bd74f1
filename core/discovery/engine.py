"""The workflow: calibrate, localise, test, nominate, screen, confirm, and say what is missing, or that nothing is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from ..effect import Effect, Evidence
from ..parameters import ParameterSpace
from .explanation import Explanation
from .findings import Findings, Listener, Nomination, Settings
from .fitting import LAG, Fitter
from .nomination import (
    is_lost,
    most_simulations,
    nominate,
    nominate_second,
    screen,
    screen_afresh,
    screen_from_priors,
)
from .problem import Problem
from .progress import Progress
from .rules import CLEAR_BIC, CLEAR_HELD, CLOSED_ENOUGH, CLOSED_FITTED, RULES, Gap, bic, bic_difference, closed
from .side_by_side import side_by_side

T = TypeVar("T")

_SECOND_EFFECTS = 4
"""Second effects that get a short refit beside a first one."""

_MORE = 2
"""Times that the best explanation's fit is gone on with, where it has not converged."""

_NEAR_TIE = 0.5
"""Share of the highest promise from which an effect is not given up after a short refit alone."""

_FAR_BEHIND = 3.0
"""Times the best one's BIC from which a single effect is no start for a pair."""

_WORTHWHILE = CLEAR_HELD**2
"""Share of a single effect's cost that a pair has to come down to in a short refit, to be fitted on: squares of errors
that are clearly smaller. True second effects come to less than half; needless ones take a few percent."""

_HINT = 0.05
"""Share of a single effect's cost that the score test of a second one must promise to be worth a short refit."""

_NEARER = 0.98
"""Share of an error that a fit has to come down to, to be gone on with."""


@dataclass(frozen=True, eq=False)
class Shortlist:
    """What is known before any effect is fitted."""

    base: Explanation
    mesh_v: float  # Root mean square of the mesh correction, V.
    # That the scores are of: of the records, or of their first cycles; on the cheaper model, if there is one.
    early_fitter: Fitter
    refitted: Explanation  # The base model that they are of: with its misfit as noise, or as the cell was new.
    as_new: bool  # Whether they are of first cycles.
    # Every effect, the most promising first; none where the base model leaves noise only.
    nominations: list[Nomination]


class Engine:
    """Runs a discovery on a problem with the uncertain parameters of the base model and a catalogue of effects.

    ``preferred``, given the scored nominations, returns keys of effects to screen in any case (a language model's
    ranking).
    """

    def __init__(
        self,
        problem: Problem,
        space: ParameterSpace,
        catalogue: Sequence[Effect],
        evidence: Evidence,
        settings: Settings | None = None,
        listener: Listener = lambda text: None,
        preferred: Callable[[Explanation, Sequence[Nomination]], Sequence[str]] | None = None,
    ) -> None:
        self.problem = problem
        self.catalogue = tuple(catalogue)
        self.evidence = evidence
        self.settings = settings or Settings()
        self._fitter = Fitter(problem, space, self.settings, listener)
        self._say = listener
        self._progress = Progress(listener)
        self._preferred = preferred

    def shortlist(self) -> Shortlist:
        """Calibrate the base model, and score every effect on what it leaves."""
        fitter = self._fitter
        base, mesh_v = fitter.calibrate()
        if base.adequacy.adequate:
            return Shortlist(base, mesh_v, fitter, base, False, [])
        self._say(f"a discrepancy of {1e3 * base.adequacy.structured_v:.2f} mV remains; nominating effects")
        near = fitter.near_new()
        early_fitter, refitted = near or (fitter, fitter.temper(base) if self._overfitted(base) else base)
        if near is None and refitted.rmse_v < base.rmse_v:
            base = refitted
        early_fitter, refitted = early_fitter.on_low_fidelity(refitted) or (early_fitter, refitted)
        nominations = nominate(early_fitter, refitted, self.catalogue, self.evidence, self._say)
        return Shortlist(base, mesh_v, early_fitter, refitted, near is not None, nominations)

    def run(self) -> Findings:
        """Carry out the whole workflow."""
        fitter, known = self._fitter, self.shortlist()
        base, mesh_v, nominations = known.base, known.mesh_v, known.nominations
        if base.adequacy.adequate:
            return Findings("no-missing-effect", base, base, reason=_why_adequate(base), mesh_v=mesh_v)
        confirmed = self.confirm(known)
        # From parameters of a new cell no effect loses its way in a short refit, and none needs a second chance.
        near_ties = [] if known.as_new else self._near_ties(confirmed, nominations)
        explanations = self.finish(base, _sorted(confirmed), near_ties)
        calibrated = base
        # A base model that started from the parameters of a new cell had the start that its explanations had.
        if explanations and fitter.as_new is None:
            base = fitter.without(base, explanations[0])
        if base.adequacy.adequate:
            reason = _why_adequate(base)
            return Findings("no-missing-effect", base, base, [], explanations, nominations, reason, mesh_v)
        unfinished = bool(explanations) and not explanations[0].adequacy.adequate
        # Over many cycles a little charge lost on the way fits what sampling hides of the current: no second effect.
        if unfinished and self.settings.max_effects > 1 and fitter.as_new is None:
            explanations = self.add_second(base, explanations, nominations)
        explanations = self._exact(explanations)
        nearest = min(calibrated, base, key=lambda fit: fit.rmse_v)
        gap = Gap(base, nearest, self.problem.noise_v, self.problem.held_noise_v)
        findings = RULES.decide(gap, explanations)
        findings.nominations, findings.mesh_v, findings.nearest_base = nominations, mesh_v, nearest
        return findings

    def _exact(self, explanations: Sequence[Explanation]) -> list[Explanation]:
        """The same, where the best one and those that might yet be its rivals end on the base model's own Jacobians."""
        near = [e for e in explanations if RULES.behind(e, explanations[0]) <= RULES.far_ahead]
        exact = self._side_by_side([partial(self._fitter.exact, explanation) for explanation in near])
        return _sorted([*exact, *(e for e in explanations if e not in near)])

    def _side_by_side(self, actions: Sequence[Callable[[], T]]) -> list[T]:
        return side_by_side(actions, self.problem.simulator.at_once)

    def _overfitted(self, base: Explanation) -> bool:
        """Whether the base model was fitted with less counted as noise than what it leaves."""
        return self.problem.misfit_v == 0.0 or base.inflated_noise_v > self.problem.misfit_v

    def confirm(self, known: Shortlist) -> list[Explanation]:
        """Screen with short refits, then fit the shortlist side by side until one is settled."""
        base, early_fitter, refitted, nominations = known.base, known.early_fitter, known.refitted, known.nominations
        keys = list(self._preferred(refitted, nominations)) if self._preferred is not None else []
        scored = [n for n in nominations if n.gain > 0]
        chosen = scored[: self.settings.screened]
        chosen += [n for n in scored[self.settings.screened :] if n.effect.key in keys]
        short = len(chosen) * most_simulations(base.fit.space)
        # Before the last level of a contest, which gets the whole budget, there may be three of a third.
        whole = 2 * min(len(chosen), self.settings.confirmed) * self.settings.refit_budget
        self._say(f"screening {len(chosen)} effects")
        self._progress.estimate(self.problem.simulated, short + whole)
        self._screen(early_fitter, refitted, chosen, known.as_new)
        misfit_v = early_fitter.problem.misfit_v
        found = self._settle(base, chosen, early_fitter)
        if known.as_new or (found and self._explains(base, found[0])):
            return found
        misjudged = [
            n for n in nominations if n.sensitivity is not None and (n not in chosen or n.promise > refitted.cost)
        ]
        if not misjudged:
            return found
        self._say(f"none of them explains half of it; refitting {len(misjudged)} effects with fresh Jacobians")
        early_fitter.problem.misfit_v = misfit_v  # the scores were taken with it
        self._refit(partial(screen_afresh, early_fitter, refitted), misjudged, refitted.cost)
        fitted = {explanation.label for explanation in found}
        fresh = self._settle(base, [n for n in nominations if n.effect.key not in fitted], early_fitter)
        return _sorted([*found, *fresh])

    def _screen(
        self, fitter: Fitter, before: Explanation, nominations: Sequence[Nomination], as_new: bool = False
    ) -> None:
        """Short refits beside what is known; also from the means of the priors where none explains most of it."""
        self._refit(partial(screen, fitter, before, as_new=as_new), nominations, before.cost)
        least = min((nomination.promise for nomination in nominations), default=0.0)
        if not as_new and is_lost(before) and least > (1.0 - CLOSED_ENOUGH) * before.cost:
            self._say("none of them explains most of it; refitting from the means of the priors")
            self._refit(partial(screen_from_priors, fitter, before), nominations, before.cost)

    def _refit(self, action: Callable[[Nomination], None], nominations: Sequence[Nomination], base_cost: float) -> None:
        """Give each nomination a short refit, side by side, and tell of each as it ends."""
        self._progress.begin(len(nominations))

        def one(nomination: Nomination) -> None:
            action(nomination)
            self._progress.refitted(nomination, base_cost)

        self._side_by_side([partial(one, nomination) for nomination in nominations])

    def _explains(self, base: Explanation, best: Explanation) -> bool:
        share = closed(base.rmse_v, best.rmse_v, self.problem.noise_v)
        return best.adequacy.adequate or share >= CLOSED_FITTED

    def add_second(
        self, base: Explanation, singles: Sequence[Explanation], nominations: Sequence[Nomination]
    ) -> list[Explanation]:
        """Fit the best single effects on with their own misfit as noise, and try a second one beside each."""
        self.problem.misfit_v = singles[0].inflated_noise_v
        near = [e for e in singles[:2] if bic(e, singles[0]) < _FAR_BEHIND * bic(singles[0], singles[0])]
        nearer = _sorted([self._fitter.again(e, self.settings.refit_budget // 2) for e in near])
        ranked = [*nearer, *singles[len(near) :]]
        if CLEAR_HELD * nearer[0].held_rmse_v < self.problem.held_noise_v:
            return self._converge(base, _sorted(ranked))  # no pair could predict data not fitted clearly better
        pairs = self.pair(base, nearer, nominations)
        result = self.prune(base, self.finish(base, _sorted([*ranked, *pairs])))
        # Of a pair with a needless effect its better half stands, and that was not the one fitted to the end.
        standing = next((e for e in result if not RULES.needless(e, result)), result[0])
        return self._converge(base, [standing, *(e for e in result if e is not standing)])

    def pair(
        self, base: Explanation, singles: Sequence[Explanation], nominations: Sequence[Nomination]
    ) -> list[Explanation]:
        """Add a second effect to the best single ones: re-score on what they leave, screen, settle."""
        screened: dict[tuple[str, ...], tuple[tuple[Effect, ...], Nomination]] = {}
        for single in singles:
            fitter, first = self._fitter.on_low_fidelity(single) or (self._fitter, single)
            beside = nominate_second(fitter, first, nominations)
            hinted = [n for n in beside[:_SECOND_EFFECTS] if n.gain > _HINT * first.cost]
            # Two that each bend the parameters to do without the other are not seen by a score on what either leaves.
            best = [n for n in beside if any(n.effect is e.effects[0] for e in singles) and n not in hinted]
            new = [n for n in (*hinted, *best) if _pair_key(first, n) not in screened]
            self._screen(fitter, first, new)
            for nomination in new:
                if nomination.promise < _WORTHWHILE * first.cost:
                    screened[_pair_key(first, nomination)] = (first.effects[0], nomination.effect), nomination
        return self._contest(base, list(screened.values()))

    def finish(
        self, base: Explanation, explanations: Sequence[Explanation], near_ties: Sequence[Nomination] = ()
    ) -> list[Explanation]:
        """Fit the best of some sorted explanations until it has converged or comes no nearer.

        Then unfinished fits that might yet be better, and near ties that were never fitted so far, are fitted from
        where it ended; if one becomes better, the fit goes on with that one.
        """
        result = self._converge(base, explanations)
        if not result or result[0].adequacy.adequate:
            return result
        leader = result[0]
        lost = [e for e in result[1:] if len(e.effects) == 1 and not e.settled and _may_yet_lead(e, leader)]
        starts = [(e.effects, e.fit) for e in lost]
        starts += [((n.effect,), n.screened) for n in near_ties if n.screened is not None]
        found = self._side_by_side(
            [partial(self._fitter.from_neighbour, effects, fit, leader) for effects, fit in starts]
        )
        for (_, fit), again in zip(starts, found, strict=True):
            known = next((e for e in lost if e.fit is fit), None)
            if again is not None and (known is None or bic_difference(known, again) > 0):
                self._fitter.tell(base, again)
                result = [*(e for e in result if e is not known), again]
        result = _sorted(result)
        if result[0] is leader:
            return result
        # It comes nearer than anything before it, so that less misfit counts as noise.
        return self._converge(base, [*self._fitter.contest(base, result[:1]), *result[1:]])

    def _near_ties(self, confirmed: Sequence[Explanation], nominations: Sequence[Nomination]) -> list[Nomination]:
        """Effects that promise nearly as much as the most promising one and were dropped after their short refits.

        Effects that consume lithium, for example, have nearly collinear sensitivities, so that their predicted gains
        are close; which of them a short refit favours is chance.
        """
        first = nominations[: self.settings.screened]
        least = _NEAR_TIE * max((n.gain for n in first), default=0.0)
        known = {explanation.label for explanation in confirmed}
        return [n for n in first if n.gain > least and n.effect.key not in known]

    def _converge(self, base: Explanation, explanations: Sequence[Explanation]) -> list[Explanation]:
        """Go on with the first one until it has converged or comes no nearer; sorted anew."""
        result = list(explanations)
        for _ in range(_MORE):
            if not result or result[0].settled or result[0].adequacy.adequate:
                break
            before = result[0].rmse_v
            result[:1] = self._fitter.contest(base, result[:1])
            if result[0].rmse_v > _NEARER * before:
                break
        return _sorted(result)

    def prune(self, base: Explanation, explanations: Sequence[Explanation]) -> list[Explanation]:
        """What is left of the best pair without its weaker effect, fitted from where the pair ended.

        A pair has had more simulations than its members, and one that is better for them alone is no pair.
        """
        result = list(explanations)
        single = self._fitter.pruned(result[0]) if len(result[0].effects) > 1 else None
        if single is not None:
            self._fitter.tell(base, single)
            known = [e for e in result if e.label == single.label]
            result = [e for e in result if e not in known] + _sorted([single, *known])[:1]
        return _sorted(result)

    def _settle(self, base: Explanation, shortlist: Sequence[Nomination], early_fitter: Fitter) -> list[Explanation]:
        """Fit the best single effects of a shortlist until one is settled."""
        return self._contest(base, [((n.effect,), n) for n in shortlist], early_fitter)

    def _contest(
        self,
        base: Explanation,
        shortlist: Sequence[tuple[tuple[Effect, ...], Nomination]],
        early_fitter: Fitter | None = None,
    ) -> list[Explanation]:
        """Fit the best of a shortlist until one is settled; at least two, so that it has a rival."""
        ranked = sorted(shortlist, key=lambda row: row[1].promise)
        kept = [(effects, n, n.screened) for effects, n in ranked if n.screened is not None]
        kept = kept[: self.settings.confirmed]
        ahead = kept[0][1].promise + LAG if kept else 0.0
        fits = [(effects, n, fit) for place, (effects, n, fit) in enumerate(kept) if place < 2 or n.promise < ahead]
        near = (early_fitter or self._fitter).problem
        running = self._fitter.taken_over(near, [(effects, fit) for effects, _, fit in fits])
        return self._fitter.contest(base, running) if running else []


def _sorted(explanations: Sequence[Explanation]) -> list[Explanation]:
    """Best first, all on one scale: the misfit of the one that comes nearest to the data."""
    if not explanations:
        return []
    nearest = min(explanations, key=lambda e: e.misfit_v)
    return sorted(explanations, key=lambda e: bic(e, nearest))


def _pair_key(first: Explanation, nomination: Nomination) -> tuple[str, ...]:
    """Which two effects, in whichever order."""
    return tuple(sorted((first.effects[0].key, nomination.effect.key)))


def _may_yet_lead(other: Explanation, leader: Explanation) -> bool:
    """Whether an explanation predicts data not fitted better than the best one, or is near it."""
    return other.held_rmse_v < leader.held_rmse_v or bic_difference(other, leader) <= 10 * CLEAR_BIC


def _why_adequate(base: Explanation) -> str:
    found = base.adequacy
    return f"noise explains the residual (size p = {found.p_size:.2g}, structure p = {found.p_structure:.2g})"
