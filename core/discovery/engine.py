"""The workflow of a discovery.

Fit the base model; score every effect on what it leaves; give the best ones a short fit, and fit those that stay near
side by side; fit what has not converged from where the best one ended; try pairs where it leaves more than noise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from ..effect import Effect, Evidence
from ..inference.problem import Problem
from ..parameters import ParameterSpace
from ..printable import counted
from .base_fit import calibrate, near_new, temper, without
from .explanation import Explanation
from .findings import Findings, Gap, Listener, Nomination, Settings
from .fitting import LAG, REFIT_BUDGET, Fitter
from .nomination import most_simulations, nominate, nominate_second, screen
from .progress import Progress
from .rules import RULES, bic_difference, ranked
from .score import overlap

_SCREENED = 6
"""Effects that get a short fit."""

_CONFIRMED = 4
"""Explanations that are fitted on, side by side, until one is settled."""

_SECOND_EFFECTS = 4
"""Second effects that get a short fit beside a first one."""

_MORE = 2
"""Times that the best explanation's fit is gone on with, where it has not converged, or leaves more than noise."""

_WORTHWHILE = (1.0 - RULES.held_margin) ** 2
"""Share of a single effect's cost that a pair has to come down to in a short fit, to be fitted on: squares of errors
that are clearly smaller. True second effects come to less than half; needless ones take a few percent."""

_HINT = 0.05
"""Share of a single effect's cost that the score test of a second one must promise to be worth a short fit."""


@dataclass(frozen=True, eq=False)
class Shortlist:
    """What is known before any effect is fitted."""

    base: Explanation
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
        self._fitter = Fitter(problem, space, listener)
        self._say = listener
        self._progress = Progress(listener)
        self._preferred = preferred

    def shortlist(self) -> Shortlist:
        """Calibrate the base model, and score every effect on what it leaves."""
        fitter = self._fitter
        base = calibrate(fitter, seed=self.settings.seed)
        if base.adequacy.adequate:
            return Shortlist(base, fitter, base, False, [])
        self._say(f"noise does not explain the {1e3 * base.rmse_v:.2f} mV that are left; scoring effects")
        near = near_new(fitter)
        # Whether it was fitted with less counted as noise than what it leaves.
        overfitted = self.problem.misfit_v == 0.0 or base.inflated_noise_v > self.problem.misfit_v
        early_fitter, refitted = near or (fitter, temper(fitter, base) if overfitted else base)
        if near is None and refitted.rmse_v < base.rmse_v:
            base = refitted
        early_fitter, refitted = early_fitter.on_low_fidelity(refitted) or (early_fitter, refitted)
        nominations = nominate(early_fitter, refitted, self.catalogue, self.evidence)
        return Shortlist(base, early_fitter, refitted, near is not None, nominations)

    def run(self) -> Findings:
        """Carry out the whole workflow."""
        fitter, known = self._fitter, self.shortlist()
        calibrated = base = known.base
        explanations = [] if base.adequacy.adequate else self.single_effects(known)
        # A base model that started from the parameters of a new cell had the start that its explanations had.
        if explanations and fitter.as_new is None:
            base, explanations = self._with_better_base(base, explanations)
        gap = self._gap(base, min(calibrated, base, key=lambda fit: fit.rmse_v))
        if not RULES.noise_suffices(gap, explanations):
            explanations = self._to_the_end(base, explanations, known.nominations)
        findings = RULES.decide(gap, explanations)
        findings.nominations, findings.mesh_v = known.nominations, self.problem.mesh_v
        if findings.verdict == "unexplained" and all(n.lacks for n in known.nominations):
            findings.reason = "no effect could be tried"
        return findings

    def _to_the_end(
        self, base: Explanation, explanations: list[Explanation], nominations: Sequence[Nomination]
    ) -> list[Explanation]:
        """The explanations as the verdict is on them: with the mesh corrected at the best one, and second effects."""
        explanations = self._with_mesh_of_best(explanations)
        unfinished = bool(explanations) and not explanations[0].adequacy.adequate
        if unfinished and self._may_name_two:
            explanations = self._with_mesh_of_best(self.add_second(base, explanations, nominations))
        # Those that decide end on the base model's own Jacobians.
        explanations = self._fitted_on(explanations, self._fitter.exact)
        for explanation in explanations:
            # Some were fitted on after their line was said. The verdict is on the last fits.
            self._fitter.tell(base, explanation, unless_told=True)
        return explanations

    @property
    def _may_name_two(self) -> bool:
        """Whether a pair of effects could be named.

        Over many cycles a small loss of charge fits what sampling hides of the current. A pair must leave noise only,
        and what the base model is known to lack stays.
        """
        lacks = self.settings.known_v > self.problem.noise_v
        return self.settings.max_effects > 1 and self._fitter.as_new is None and not lacks

    def _with_better_base(
        self, base: Explanation, explanations: list[Explanation]
    ) -> tuple[Explanation, list[Explanation]]:
        """The base model fitted from where the best explanation ended, and explanations that are no worse than that.

        An effect at its null is the base model: one whose fit is farther off is fitted again from there.
        """
        better = without(self._fitter, base, explanations[0])
        if better is base:
            return base, explanations
        if better.inflated_noise_v < self.problem.misfit_v:
            self.problem.misfit_v = better.inflated_noise_v
            better = self._fitter.again(better, REFIT_BUDGET // 2)
        # The gap is measured from the nearer of the two, see `Gap`.
        farther = better.rmse_v > base.rmse_v
        why = " (likelier, though farther off than the first fit, from which the report measures the gap)" * farther
        self._say(f"base model, from where {explanations[0].label} ended: {1e3 * better.rmse_v:.2f} mV{why}")
        behind = [e for e in explanations if e.rmse_v > better.rmse_v]
        fits = [partial(self._fitter.from_neighbour, e.effects, e.fit, better) for e in behind]
        again = {e.label: found for e, found in zip(behind, self.problem.side_by_side(fits), strict=True) if found}
        result = ranked([again.get(e.label, e) for e in explanations])
        for explanation in result:
            self._fitter.tell(better, explanation)
        return better, result

    def _gap(self, base: Explanation, nearest: Explanation) -> Gap:
        return Gap(base, nearest, self.problem.noise_v, self.problem.held_noise_v, self.settings.known_v)

    # --- single effects -------------------------------------------------------------------------------------

    def single_effects(self, known: Shortlist) -> list[Explanation]:
        """Fit the effects that the scores favour; all the others too, where those explain little. Best first."""
        fitter, before, nominations = known.early_fitter, known.refitted, known.nominations
        keys = list(self._preferred(before, nominations)) if self._preferred is not None else []
        favoured = [n for n in nominations if n.gain > 0][:_SCREENED]
        chosen = [n for n in nominations if n in favoured or (n.effect.key in keys and not n.lacks)]
        self._say(f"short fits of {counted(len(chosen), 'effect')}")
        # Before the last level of a race, which gets the whole budget, there may be three of a third.
        whole = 2 * min(len(chosen), _CONFIRMED) * REFIT_BUDGET
        self._progress.estimate(self.problem.simulated, len(chosen) * most_simulations(before) + whole)
        misfit_v = fitter.problem.misfit_v
        self._screen(fitter, before, chosen, as_new=known.as_new)
        found = self._race(known.base, chosen, fitter.problem)
        if known.as_new:
            return self.finish(known.base, found)
        if not found or RULES.leaves_too_much(found[0], self._gap(known.base, known.base)):
            rest = [n for n in nominations if n.sensitivity is not None and n.promise > before.cost]
            if rest:
                self._say(f"none explains enough; fitting {counted(len(rest), 'effect')} with strengths of either sign")
            self._progress.estimate(self.problem.simulated, 2 * len(rest) * most_simulations(before))
            fitter.problem.misfit_v = misfit_v  # the scores were taken with it
            self._screen(fitter, before, rest, either_sign=True)
            labels = {explanation.label for explanation in found}
            more = [n for n in nominations if n.effect.key not in labels]
            found = ranked([*found, *self._race(known.base, more, fitter.problem)])
        alike = self._screen_alike(known, found, misfit_v)
        found = ranked([*found, *self._race(known.base, alike, fitter.problem)])
        return self.finish(known.base, found, nominations)

    def _screen_alike(self, known: Shortlist, found: Sequence[Explanation], scored_with_v: float) -> list[Nomination]:
        """Give short fits to effects without one whose sensitivities are nearly collinear with that of the best one.

        Where the score is wrong about the sign, it has passed over them. An effect is taken if what it leaves of the
        best one's gain would not decide between the two. ``scored_with_v`` is the misfit that the scores were taken
        with, V.
        """
        gain = bic_difference(known.base, found[0]) if found else 0.0
        if gain <= RULES.clear_bic:
            return []
        best = next(n.sensitivity for n in known.nominations if (n.effect,) == found[0].effects)
        assert best is not None  # it had a short fit
        share = 1.0 - RULES.clear_bic / gain
        alike = [
            n
            for n in known.nominations
            if n.screened is None
            and n.sensitivity is not None
            and overlap(known.refitted.fit, best, n.sensitivity) > share
        ]
        near, reached_v = known.early_fitter.problem, known.early_fitter.problem.misfit_v
        near.misfit_v = scored_with_v
        self._screen(known.early_fitter, known.refitted, alike, either_sign=True)
        near.misfit_v = reached_v
        return alike

    def _screen(
        self,
        fitter: Fitter,
        before: Explanation,
        nominations: Sequence[Nomination],
        as_new: bool = False,
        either_sign: bool = False,
    ) -> None:
        """Give each nomination its short fits, side by side, and tell of each as they end; see `screen`."""
        self._progress.begin(len(nominations))

        def one(nomination: Nomination) -> None:
            screen(fitter, before, nomination, as_new, either_sign)
            left = f"a short fit leaves {nomination.promise / before.cost:.0%} of the squared misfit"
            self._progress.ended(nomination.effect.key, "cannot be fitted" if nomination.screened is None else left)

        self.problem.side_by_side([partial(one, nomination) for nomination in nominations])

    def _race(self, base: Explanation, screened: Sequence[Nomination], near: Problem) -> list[Explanation]:
        """Fit the best of what was screened until one is settled; at least two, so that it has a rival.

        ``near`` is the problem of the short fits.
        """
        best = sorted(screened, key=lambda n: n.promise)[:_CONFIRMED]
        fits = [
            (n.effects, n.screened)
            for place, n in enumerate(best)
            if n.screened is not None and (place < 2 or n.promise < best[0].promise + LAG)
        ]
        running = self._fitter.taken_over(near, fits)
        return self._fitter.contest(base, running) if running else []

    # --- a second effect ------------------------------------------------------------------------------------

    def add_second(
        self, base: Explanation, singles: Sequence[Explanation], nominations: Sequence[Nomination]
    ) -> list[Explanation]:
        """Fit the best two single effects on with their own misfit as noise, and try a second one beside each."""
        self.problem.misfit_v = singles[0].inflated_noise_v
        # No second effect is added to one that is no better than the base model.
        firsts = [e for e in singles[:2] if e is singles[0] or bic_difference(base, e) > 0]
        nearer = ranked([self._fitter.again(e, REFIT_BUDGET // 2) for e in firsts])
        everything = ranked([*nearer, *singles[len(firsts) :]])
        if (1.0 - RULES.held_margin) * nearer[0].held_rmse_v >= self.problem.held_noise_v:
            # Else no pair could predict data not fitted clearly better.
            everything += self.pair(base, nearer, nominations)
        return self.finish(base, ranked(everything))

    def pair(
        self, base: Explanation, singles: Sequence[Explanation], nominations: Sequence[Nomination]
    ) -> list[Explanation]:
        """Add a second effect to the best single ones: score on what they leave, screen, fit side by side."""
        tried: dict[frozenset[str], Nomination] = {}
        for single in singles:
            fitter, first = self._fitter.on_low_fidelity(single) or (self._fitter, single)
            beside = nominate_second(fitter, first, nominations)
            hinted = [n for n in beside[:_SECOND_EFFECTS] if n.gain > _HINT * first.cost]
            # If the parameters compensate for the other effect in each of the two fits, no score shows the pair.
            best = [n for n in beside if any(n.effect is e.effects[0] for e in singles) and n not in hinted]
            pairs = {frozenset((first.label, n.effect.key)): n for n in (*hinted, *best)}
            new = {key: n for key, n in pairs.items() if key not in tried}
            self._screen(fitter, first, list(new.values()))
            tried |= {key: n for key, n in new.items() if n.promise < _WORTHWHILE * first.cost}
        return self._race(base, list(tried.values()), self.problem)

    # --- to the end -----------------------------------------------------------------------------------------

    def finish(
        self, base: Explanation, explanations: Sequence[Explanation], nominations: Sequence[Nomination] = ()
    ) -> list[Explanation]:
        """Fit the best of some explanations until it has converged, and then single effects from where it ended.

        These are the ones whose own fit has not converged; those that the best one has besides another, which had fewer
        simulations; and those of the nominations that were dropped after a short fit. Where the best one leaves only
        noise, these are fitted if this is a better start than their own fit: one of them may have lagged by chance.
        """
        result = self._converge(base, explanations)
        if not result:
            return result
        leader = result[0]
        singles = [e for e in result[1:] if len(e.effects) == 1 and (not e.settled or e.effects[0] in leader.effects)]
        fits: list[Callable[[], Explanation | None]] = [
            partial(self._fitter.from_neighbour, e.effects, e.fit, leader) for e in singles
        ]
        known = {e.label for e in result}
        fits += [
            partial(self._fitter.from_neighbour, n.effects, n.screened, leader, leader.adequacy.adequate)
            for n in nominations
            if n.screened is not None and n.effect.key not in known
        ]
        best = {e.label: e for e in result}
        for found in self.problem.side_by_side(fits):
            if found is not None and (found.label not in best or bic_difference(best[found.label], found) > 0):
                self._fitter.tell(base, found)
                best[found.label] = found
        result = ranked(list(best.values()))
        # What comes nearer than anything before it is fitted on: less misfit counts as noise.
        return result if result[0] is leader else self._converge(base, result, 1)

    def _converge(self, base: Explanation, explanations: Sequence[Explanation], least: int = 0) -> list[Explanation]:
        """Go on with the best one until it has converged, ``least`` times at least; sorted anew.

        Of a pair with a needless effect its better half stands, and that is gone on with.
        """
        result = ranked(explanations)
        for number in range(_MORE):
            best = next((e for e in result if not RULES.needless(e, result)), None)
            if best is None or (number >= least and (best.settled or best.adequacy.adequate)):
                break
            result = ranked([*self._fitter.contest(base, [best]), *(e for e in result if e is not best)])
        return result

    def _with_mesh_of_best(self, explanations: Sequence[Explanation]) -> list[Explanation]:
        """The same if the best one leaves only noise; else fitted on with the mesh corrected where that one ended."""
        result = list(explanations)
        for _ in range(_MORE):
            if not result or result[0].adequacy.adequate:
                break
            best = result[0]
            if not self.problem.correct_mesh_anew(best.effects, best.fit.candidate):
                break
            self.problem.misfit_v = min(self.problem.misfit_v, best.counts_as_noise_v)
            result = self._fitted_on(result, partial(self._fitter.again, budget=REFIT_BUDGET // 2))
        return result

    def _fitted_on(
        self, explanations: Sequence[Explanation], go_on: Callable[[Explanation], Explanation]
    ) -> list[Explanation]:
        """The best one and those that might yet be its rivals fitted on, side by side, and the others as they are.

        One that has not converged might be a rival whatever its distance.
        """
        near = [e for e in explanations if RULES.behind(e, explanations[0]) <= RULES.far_ahead or not e.settled]
        again = self.problem.side_by_side([partial(go_on, explanation) for explanation in near])
        return ranked([*again, *(e for e in explanations if e not in near)])
