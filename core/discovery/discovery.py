"""The answer of a discovery, ready for ``discovery.json``."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from .closure import Closure
from .explanation import Explanation
from .findings import Findings, Nomination
from .localisation import Place
from .next_experiment import NextExperiment
from .ranking import Ranking
from .rules import RULES, Gap, bic, bic_difference, closed

Json = dict[str, Any]


@dataclass(eq=False)
class Discovery:
    """What was found, with the evidence."""

    findings: Findings  # The engine's own account.
    # noise_v, held_noise_v: Measurement noise of the fitted records and of the data not fitted, V.
    noise_v: float
    held_noise_v: float
    # places_before, places_after: Residual maps of the base model and of the best explanation.
    places_before: list[Place]
    places_after: list[Place]
    sentences: list[str]  # The first map in words.
    next_experiment: NextExperiment | None = None  # What would separate the best explanation from its nearest rival.
    closure: Closure | None = None  # Empirical correction, where nothing explains the discrepancy.
    ranking: Ranking | None = None  # What a language model said.
    # By record: error of the predicted temperature, which no fit is shown, K.
    temperature_rms_k: dict[str, float] = field(default_factory=dict)
    simulations: int = 0  # Single-record solves.
    wall_s: float = 0.0
    notes: list[str] = field(default_factory=list)  # What was assumed.
    script: str = ""  # Source of ``augmented_model.py``: the best explanation, in the simulator's own language.

    @property
    def verdict(self) -> str:
        """``"effect-found"``, ``"no-missing-effect"``, ``"ambiguous"`` or ``"unexplained"``."""
        return self.findings.verdict

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects found; empty unless the verdict is ``"effect-found"`` or ``"ambiguous"``."""
        return self.findings.best.names if self.verdict in ("effect-found", "ambiguous") else ()

    @property
    def gap(self) -> dict[str, float]:
        """How the gap shrank, in mV, and the share that is closed."""
        base, best = self.findings.nearest_base, self.findings.best
        return {
            "noise_mv": 1e3 * self.noise_v,
            "base_rmse_mv": 1e3 * base.rmse_v,
            "final_rmse_mv": 1e3 * best.rmse_v,
            "holdout_base_rmse_mv": 1e3 * base.held_rmse_v,
            "holdout_final_rmse_mv": 1e3 * best.held_rmse_v,
            "closed": closed(base.rmse_v, best.rmse_v, self.noise_v),
            "holdout_closed": closed(base.held_rmse_v, best.held_rmse_v, self.held_noise_v),
        }

    def to_json(self) -> Json:
        """The contents of ``discovery.json``."""
        found = self.findings
        named = self.verdict in ("effect-found", "ambiguous")
        content = {
            "verdict": self.verdict,
            "reason": found.reason,
            "effects": self._effects(found.best) if named else [],
            "partial": self._effects(found.best) if self.verdict == "unexplained" else [],
            "base_parameters": found.best.fit.candidate,
            "localisation": [asdict(place) for place in self.places_before],
            "localisation_after": [asdict(place) for place in self.places_after],
            "in_words": self.sentences,
            "candidates": self._candidates(),
            "gap": self.gap,
            "next_experiment": None if self.next_experiment is None else asdict(self.next_experiment),
            "closure": None if self.closure is None else asdict(self.closure),
            "backend_ranking": None if self.ranking is None else asdict(self.ranking),
            "temperature_rms_k": self.temperature_rms_k,
            "mesh_correction_mv": 1e3 * found.mesh_v,
            "false_alarm_rate": 0.01,
            "simulations": self.simulations,
            "wall_s": self.wall_s,
            "notes": self.notes,
        }
        cleaned: Json = finite(content)
        return cleaned

    def _effects(self, best: Explanation) -> list[Json]:
        rivals = [list(rival.names) for rival in self.findings.rivals]
        margin = bic_difference(self.findings.base, best)
        rows = []
        for effect in best.effects:
            nomination = next((n for n in self.findings.nominations if n.effect.key == effect.key), None)
            rows.append(
                {
                    "name": effect.name,
                    "variant": effect.variant,
                    "equation": effect.equation,
                    "parameters": [asdict(estimate) for estimate in best.estimates[effect.key]],
                    "delta_bic": margin,
                    "rationale": self._rationale(effect.signature, nomination),
                    "indistinguishable_from": rivals,
                    "citation": effect.citation,
                }
            )
        return rows

    def _rationale(self, signature: str, nomination: Nomination | None) -> str:
        text = f"expected signature: {signature}."
        if self.sentences:
            text += f" Seen: {self.sentences[0]}."
        if self.ranking is not None and nomination is not None:
            text += "".join(f" Backend: {r.reason}" for r in self.ranking.ranked if r.key == nomination.effect.key)
        return text

    def _candidates(self) -> list[Json]:
        found = self.findings
        fitted: dict[str, Explanation] = {e.label: e for e in found.explanations}
        order = {r.key: k for k, r in enumerate(self.ranking.ranked, start=1)} if self.ranking else {}
        rows: list[Json] = []
        for nomination in found.nominations:
            explanation = fitted.pop(nomination.effect.key, None)
            row: Json = {
                "name": nomination.effect.name,
                "variant": nomination.effect.variant,
                "score": None if nomination.score is None else asdict(nomination.score),
                "backend_rank": order.get(nomination.effect.key),
            }
            rows.append(row | self._confirmed(explanation, nomination))
        for label, explanation in fitted.items():
            rows.append({"name": label, "variant": "", "score": None} | self._confirmed(explanation, None))
        # What was fitted first, the best evidence leading; then what the score test alone has seen.
        return sorted(rows, key=lambda row: math.inf if row["delta_bic"] is None else -row["delta_bic"])

    def _confirmed(self, explanation: Explanation | None, nomination: Nomination | None) -> Json:
        found = self.findings
        if explanation is None:
            reason = nomination.lacks if nomination is not None else ""
            if not reason and nomination is not None:
                score = nomination.score
                if score is None or score.gain <= 0:
                    reason = "the score test predicts no gain in the allowed direction"
                elif nomination.screened is None:
                    reason = "the score test predicts less gain than for others"
                else:
                    reason = "a short refit gained less than others"
            empty = dict.fromkeys(("refit_rmse_mv", "bic", "delta_bic", "holdout_rmse_mv"))
            return {**empty, "rejected": reason}
        if explanation is found.best and self.verdict in ("effect-found", "ambiguous"):
            reason = ""
        elif explanation in found.rivals:
            reason = "cannot be told from the best"
        else:
            reason = RULES.objection_to(
                explanation, Gap(found.base, found.nearest_base, self.noise_v, self.held_noise_v)
            )
            reason = reason or "explains the data less well than the best, or needs more effects for the same"
        return {
            "refit_rmse_mv": 1e3 * explanation.rmse_v,
            "bic": bic(explanation, found.best),
            "delta_bic": bic_difference(found.base, explanation),
            "holdout_rmse_mv": 1e3 * explanation.held_rmse_v,
            "temperature_rms_k": explanation.temperature_rms_k,
            "parameters": {key: [asdict(e) for e in rows] for key, rows in explanation.estimates.items()},
            "converged": explanation.settled,
            "leaves_noise_only": explanation.adequacy.adequate,
            "rejected": reason,
        }


def finite(value: Any) -> Any:
    """The same content with what JSON cannot say as None, and NumPy's numbers as Python's."""
    if isinstance(value, dict):
        return {str(key): finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(entry) for entry in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value
