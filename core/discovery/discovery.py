"""The answer of a discovery, ready for ``discovery.json``."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar

from ..effect import Effect
from ..numbers import json_ready
from .explanation import Explanation
from .findings import Findings, Nomination
from .ranking import Ranking
from .rules import RULES, Rules, bic_difference

Json = dict[str, Any]


@dataclass(eq=False)
class Discovery(ABC):
    """What was found, with the evidence."""

    rules: ClassVar[Rules] = RULES  # By which it was decided.
    # noun, explained, nothing: What the headline calls what is looked for, what that explains, and that none is needed.
    noun: ClassVar[str] = "effect"
    explained: ClassVar[str] = "the discrepancy"
    nothing: ClassVar[str] = "Nothing is missing: noise explains what the base model leaves"
    # By name and unit, two entries of the gap: an error of the base model, and with the effects.
    told: ClassVar[dict[str, tuple[str, str]]]

    findings: Findings  # The engine's own account.
    notes: list[str] = field(default_factory=list, kw_only=True)  # What was assumed.
    restricted: bool = field(default=False, kw_only=True)  # Whether only effects that were asked for were considered.
    ranking: Ranking | None = field(default=None, kw_only=True)  # What a language model said, where one was asked.
    simulations: int = field(default=0, kw_only=True)  # Single solves.
    wall_s: float = field(default=0.0, kw_only=True)  # Of each time that it was taken up, together.
    # Source of ``augmented_model.py``: the best explanation, in the simulator's own language.
    script: str = field(default="", kw_only=True)

    @property
    def verdict(self) -> str:
        """``"effect-found"``, ``"no-missing-effect"``, ``"ambiguous"`` or ``"unexplained"``."""
        return self.findings.verdict

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects found; empty unless the verdict is ``"effect-found"`` or ``"ambiguous"``."""
        return self.findings.best.names if self.named else ()

    @property
    def named(self) -> bool:
        """Whether the verdict names an effect."""
        return self.verdict in ("effect-found", "ambiguous")

    @property
    def headline(self) -> str:
        """The verdict as a sentence. Where more than noise is left, an effect explains a part."""
        if self.verdict == "no-missing-effect":
            return self.nothing
        if self.verdict == "unexplained":
            return self._unexplained()
        count, verb, tail = "one", "explains", ""
        if self.verdict == "ambiguous":
            count, verb, tail = "several", "explain", " and cannot be told apart"
        elif len(self.names) > 1:
            count, verb, tail = "two", "explain", " together"
        part = "" if self.findings.best.adequacy.adequate else "part of "
        who = f"{count.capitalize()} {self.noun}{'s' * (count != 'one')}"
        return f"{self._among(count) or who} {verb} {part}{self.explained}{tail}"

    def _unexplained(self) -> str:
        if not self._tried:
            return f"No {self.noun} could be tried that would explain {self.explained}"
        if self._tried == 1 and not self.restricted:
            return f"The one {self.noun} that was tried does not explain {self.explained}"
        who = self._among("none") or f"None of the {self._tried} {self.noun}s that were tried"
        return f"{who} explains {self.explained}"

    def _among(self, count: str) -> str:
        return f"Of the {self.noun}s that were asked for, {count}" if self.restricted else ""

    @property
    def _tried(self) -> int:
        return sum(not nomination.lacks for nomination in self.findings.nominations)

    @property
    def parameters(self) -> dict[str, float]:
        """Fitted values by name: the base model's own, and the effects' parameters."""
        return {name: float(value) for name, value in self.findings.best.fit.candidate.items()}

    @property
    @abstractmethod
    def gap(self) -> dict[str, float]:
        """How the gap shrank, and the share that is closed; not a number where there was none."""

    @property
    def errors(self) -> dict[str, dict[str, float | None]]:
        """``"initial"`` (base model) and ``"best"`` (with the effects) error, by name and unit."""
        gap = json_ready(self.gap)
        return {name: {"initial": gap[before], "best": gap[after]} for name, (before, after) in self.told.items()}

    def to_json(self) -> Json:
        """The contents of ``discovery.json``."""
        found = self.findings
        content = {
            "verdict": self.verdict,
            "headline": self.headline,
            "reason": found.reason,
            "effects": self._effects(found.best) if self.named else [],
            "partial": self._effects(found.best) if self.verdict == "unexplained" else [],
            "base_parameters": self.parameters,
            "candidates": self._candidates(),
            "gap": self.gap,
            **self._evidence(),
            "simulations": self.simulations,
            "wall_s": self.wall_s,
            "notes": self.notes,
        }
        cleaned: Json = json_ready(content)
        return cleaned

    @abstractmethod
    def _evidence(self) -> Json:
        """What this kind of discovery has besides."""

    @abstractmethod
    def _seen(self, explanation: Explanation | None, nomination: Nomination | None) -> Json:
        """What a candidate's row says in this kind of discovery's own units."""

    def _effects(self, best: Explanation) -> list[Json]:
        rivals = [list(rival.names) for rival in self.findings.rivals]
        margin = bic_difference(self.findings.base, best)
        return [
            {
                "name": effect.name,
                "variant": effect.variant,
                "equation": effect.equation,
                "parameters": [estimate.to_json() for estimate in best.estimates[effect.key]],
                "delta_bic": margin,
                "rationale": self._rationale(effect),
                "indistinguishable_from": rivals,
                "citation": effect.citation,
            }
            for effect in best.effects
        ]

    def _rationale(self, effect: Effect) -> str:
        return f"Expected signature: {effect.signature.rstrip('.')}."

    def _candidates(self) -> list[Json]:
        fitted: dict[str, Explanation] = {e.label: e for e in self.findings.explanations}
        rows: list[Json] = []
        for nomination in self.findings.nominations:
            effect, explanation = nomination.effect, fitted.pop(nomination.effect.key, None)
            why = {"delta_bic": None, "rejected": self._not_fitted(nomination)}
            told = why if explanation is None else self._fitted(explanation)
            seen = self._seen(explanation, nomination)
            rows.append({"name": effect.name, "variant": effect.variant, **seen, **told})
        pairs = fitted.items()
        rows += [{"name": label, "variant": "", **self._seen(e, None), **self._fitted(e)} for label, e in pairs]
        # What was fitted first, the best evidence leading; then what the score test alone has seen.
        return sorted(rows, key=lambda row: math.inf if row["delta_bic"] is None else -row["delta_bic"])

    def _fitted(self, explanation: Explanation) -> Json:
        """What the row of a candidate says that was fitted."""
        return {
            "delta_bic": bic_difference(self.findings.base, explanation),
            "parameters": {key: [e.to_json() for e in rows] for key, rows in explanation.estimates.items()},
            "converged": explanation.settled,
            "leaves_noise_only": explanation.adequacy.adequate,
            "rejected": self._rejected(explanation),
        }

    def _not_fitted(self, nomination: Nomination) -> str:
        """Why an effect was not fitted, or its fit dropped."""
        return nomination.lacks

    def _rejected(self, explanation: Explanation) -> str:
        if explanation is self.findings.best and self.named:
            return ""
        if explanation in self.findings.rivals:
            return "cannot be told from the best"
        reason = self.rules.objection_to(explanation, self.findings.gap)
        return reason or "explains the data less well than the best, or needs more effects for the same"
