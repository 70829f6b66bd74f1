"""Which mechanism ages a cell: each is fitted to the same life, and the rules of a discovery decide.

What the fitted cycles have in common is taken out of the residuals (`Changes`), so that a cell that is not met quite
right stands for no mechanism. Later cycles are never fitted.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..ageing.changes import Changes, of_cycles
from ..effect import Effect
from ..inference.adequacy import judge
from ..inference.refit import Refit, refit
from ..inference.side_by_side import side_by_side
from ..parameters import Candidate, ParameterSpace
from ..trajectory import FloatArray
from .explanation import Explanation, estimates_of
from .findings import Findings, Gap, Listener, Nomination
from .progress import Progress
from .rules import Rules, ranked

Simulate = Callable[[tuple[Effect, ...], Sequence[Candidate]], Sequence[FloatArray | None]]
"""The residuals of a life's task with some effects, for values of their parameters; None where it failed."""

Fitted = Explanation | str
"""What the fit of a mechanism comes to, or why there is none."""

_SCANNED = 8
"""Strengths that are tried over the range of each mechanism, and, where the least is too large, as far below: rates
differ from cell to cell by orders of magnitude."""

_BELOW = 0.1
"""Least strength that is tried, in probes: effects that are smaller hardly show in hundreds of cycles."""

_BEYOND = 2
"""Strengths in a row that come no nearer, after which larger ones are not tried."""

_WORSE = 2.0
"""Times the cost of no ageing at which a strength is too large, though none was better."""

_BUDGET = 25
"""Simulations of each fit at most: one or two strengths are fitted."""

_SHARE = 0.3
"""Deviation of a strength that a scan has found, as a share of it: the unit of a fit's steps."""

_SECOND = 0.1
"""Share of its own best strength at which a second mechanism begins beside a first one."""

_NO_NEARER = "comes no nearer to the life than the cell without it"
_NOT_SIMULATED = "could not be simulated, at any strength that was tried"
_NOT_FITTED = "could not be fitted"

DEVIATION_V = 1e-3
"""What a standard deviation counts as, V, for rules that are about voltages: a good cycler's millivolt."""


LIFE_RULES = Rules(base_words="the cell without ageing", held_words="the later cycles")
"""The same rules, in words for a life."""


class LifeEngine:
    """Fits mechanisms to a life and judges them.

    ``at_once`` is how many fits run side by side: as many as there are simulations at a time.
    """

    def __init__(
        self,
        simulate: Simulate,
        changes: Changes,
        listener: Listener = lambda text: None,
        max_effects: int = 2,
        at_once: int = 1,
    ) -> None:
        self._simulate, self._changes, self._say = simulate, changes, listener
        self._max_effects, self._at_once = max_effects, at_once
        self._progress = Progress(listener)

    def run(self, catalogue: Sequence[Effect]) -> Findings:
        """Fit every effect, then the best with each of the others, and decide."""
        (nothing,) = self._residuals((), [{}])
        assert nothing is not None, "the cell without ageing runs: its first cycle was fitted"
        base = self._explanation((), self._unchanged(nothing))
        self._say(f"without ageing: {_in_words(base)}")
        gap = Gap(base, base, DEVIATION_V, DEVIATION_V)
        if base.adequacy.adequate:
            return Findings("no-missing-effect", gap, base, reason="noise explains what changes from cycle to cycle")
        singles = self._fits({effect.key: partial(self._single, effect, base) for effect in catalogue})
        found = ranked(_fitted(singles))
        if found and self._max_effects > 1 and not found[0].adequacy.adequate:
            others = [one for one in found[1:] if one.names != found[0].names]
            pairs = self._fits(
                {f"{found[0].label} + {one.label}": partial(self._pair, found[0], one) for one in others}
            )
            # A second mechanism also makes up for a law of the first that is not quite the cell's: only one with which
            # nothing is left is a mechanism.
            found = ranked([*found, *(pair for pair in _fitted(pairs) if pair.adequacy.adequate)])
        findings = LIFE_RULES.decide(gap, found)
        if findings.verdict == "unexplained":
            findings.reason = _unexplained(catalogue, singles, findings.reason if found else "")
        findings.nominations = [
            Nomination(effect, one if isinstance(one := singles[effect.key], str) else "") for effect in catalogue
        ]
        return findings

    def _fits(self, fits: Mapping[str, Callable[[], Fitted]]) -> dict[str, Fitted]:
        """What fits come to, side by side; each is told of as it ends."""
        self._progress.begin(len(fits))

        def one(label: str, fit: Callable[[], Fitted]) -> Fitted:
            found = fit()
            self._progress.ended(label, found if isinstance(found, str) else _in_words(found))
            return found

        found = side_by_side([partial(one, label, fit) for label, fit in fits.items()], self._at_once)
        return dict(zip(fits, found, strict=True))

    def _residuals(self, effects: tuple[Effect, ...], candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        """The changes of all cycles."""
        found = self._simulate(effects, candidates)
        return [None if one is None else self._changes(one) for one in found]

    def _fitted(self, effects: tuple[Effect, ...], candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        found = self._residuals(effects, candidates)
        return [None if one is None else one[self._changes.fitted] for one in found]

    def _unchanged(self, changes: FloatArray) -> Refit:
        seen = changes[self._changes.fitted]
        return Refit(ParameterSpace(()), np.zeros(0), seen, np.zeros((len(seen), 0)), True, promised=0.0)

    def _single(self, effect: Effect, base: Explanation) -> Fitted:
        """The best fit of an effect."""
        strengths = np.geomspace(_BELOW * effect.strength.probe, effect.strength.upper, _SCANNED)
        best, least, simulated = self._scan(effect, base, strengths)
        if not best and least > _WORSE * base.fit.cost:
            # A strength that is small in one cell may end another.
            best, _, seen = self._scan(effect, base, strengths[0] * strengths[0] / strengths[1:])
            simulated = simulated or seen
        if not best:
            return _NO_NEARER if simulated else _NOT_SIMULATED
        return self._fit((effect,), {effect.full_name(effect.strength): best})

    def _scan(self, effect: Effect, base: Explanation, strengths: FloatArray) -> tuple[float, float, bool]:
        """Try strengths in their order, until they come no nearer.

        The nearest one, 0 where none is nearer than no ageing; the least cost of all, infinite where none could be
        simulated; and whether one could.
        """
        best, least, beyond, rising = 0.0, np.inf, 0, bool(strengths[-1] > strengths[0])
        for value in strengths:
            (seen,) = self._fitted((effect,), [{effect.full_name(effect.strength): float(value)}])
            cost = np.inf if seen is None else float(seen @ seen)
            if cost < min(least, base.fit.cost):
                best, beyond = float(value), 0
            # Far below what shows, a cost is that of none but for the integrator's error.
            elif best or (rising and cost > _WORSE * base.fit.cost):
                beyond += 1
            least = min(least, cost)
            if beyond == _BEYOND:
                break
        return best, least, bool(np.isfinite(least))

    def _pair(self, first: Explanation, second: Explanation) -> Fitted:
        effects = (*first.effects, *second.effects)
        (other,) = second.effects
        start = {**first.fit.candidate, **second.fit.candidate}
        start[other.full_name(other.strength)] *= _SECOND
        return self._fit(effects, start)

    def _fit(self, effects: tuple[Effect, ...], start: Candidate) -> Fitted:
        strengths = {effect.full_name(effect.strength) for effect in effects}
        space = ParameterSpace(
            tuple(
                replace(p, initial=start[p.name], deviation=_SHARE * start[p.name])
                if p.name in strengths and not p.prior
                else p
                for effect in effects
                for p in effect.searched
            )
        )
        begin = np.array([p.coordinate(start.get(p.name, p.initial)) for p in space])
        fit = refit(lambda candidates: self._fitted(effects, candidates), space, begin, budget=_BUDGET)
        return _NOT_FITTED if fit is None else self._explanation(effects, fit)

    def _explanation(self, effects: tuple[Effect, ...], fit: Refit) -> Explanation:
        (all_cycles,) = self._residuals(effects, [fit.candidate])
        assert all_cycles is not None, "a fit ends where it could be simulated"
        errors, sigma = DEVIATION_V * all_cycles[self._changes.fitted], np.full(len(fit.residual), DEVIATION_V)
        steps = self._changes.steps[self._changes.fitted]
        found = Explanation(
            effects,
            fit,
            judge(errors / sigma, steps, np.hstack([self._changes.taken, fit.taken])),
            DEVIATION_V * of_cycles(all_cycles, self._changes.fitted),
            DEVIATION_V * of_cycles(all_cycles, self._changes.held),
            errors,
            sigma,
            taken_off=self._changes.common,
        )
        found.estimates = estimates_of(effects, fit, found.dispersion(0.0))
        return found


def _fitted(fits: Mapping[str, Fitted]) -> list[Explanation]:
    return [one for one in fits.values() if not isinstance(one, str)]


def _unexplained(tried: Sequence[Effect], fits: Mapping[str, Fitted], nearest: str) -> str:
    """What it means that no mechanism is named: which were tried, how near they came, what is left to suppose.

    ``nearest`` is the mechanism that came nearest, with what speaks against it; empty where none came any nearer.
    """
    if not tried:
        return "no mechanism could be tried: each of those that were asked for is ruled out for this cell or its model"
    lost = [effect for effect in tried if fits[effect.key] in (_NOT_SIMULATED, _NOT_FITTED)]
    if nearest:
        came = f"the nearest of them, {nearest}"
    elif len(lost) < len(tried):
        came = "at no strength does one of them come nearer to the life than the cell without ageing"
    else:
        came = "none of them could be simulated and fitted"
    if lost and len(lost) < len(tried):
        came += f"; not to be simulated or fitted: {_listed(lost)}"
    return (
        f"of the mechanisms that were tried, none explains how the cell changes from cycle to cycle: {_listed(tried)}; "
        f"{came}. The cell ages in a way that is not among them, or the fit of its first cycle is too far off for one "
        "to show"
    )


def _listed(effects: Sequence[Effect]) -> str:
    """``"sei-growth (reaction-limited, diffusion-limited), lithium-plating"``."""
    variants: dict[str, list[str]] = {}
    for effect in effects:
        variants.setdefault(effect.name, []).extend([effect.variant] * bool(effect.variant))
    return ", ".join(f"{name} ({', '.join(found)})" if found else name for name, found in variants.items())


def _in_words(found: Explanation) -> str:
    return f"{found.rmse_v / DEVIATION_V:.2f} deviations, later cycles {found.held_rmse_v / DEVIATION_V:.2f}"
