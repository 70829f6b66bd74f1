"""The answer of a discovery on measured records."""

from dataclasses import asdict, dataclass, field
from typing import ClassVar

from ..effect import Effect
from .closure import Closure
from .discovery import Discovery, Json
from .explanation import Explanation
from .findings import Nomination
from .localisation import Place
from .next_experiment import NextExperiment
from .rules import RULES, bic, closed


@dataclass(eq=False)
class RecordDiscovery(Discovery):
    """What was found to be missing in a model of records."""

    told: ClassVar = {
        "Voltage RMSE [mV]": ("base_rmse_mv", "final_rmse_mv"),
        "Voltage RMSE of records not fitted [mV]": ("holdout_base_rmse_mv", "holdout_final_rmse_mv"),
    }

    # places_before, places_after: Residual maps of the base model and of the best explanation.
    places_before: list[Place]
    places_after: list[Place]
    sentences: list[str]  # The first map in words.
    capacity_ah: float  # Charge of the cell between its cut-offs at rest, which C-rates count in, A.h.
    next_experiment: NextExperiment | None = None  # What would separate the best explanation from its nearest rival.
    closure: Closure | None = None  # Empirical correction, where nothing explains the discrepancy.
    # By record: error of the predicted temperature, which no fit is shown, K.
    temperature_rms_k: dict[str, float] = field(default_factory=dict)

    @property
    def gap(self) -> dict[str, float]:
        """See `Discovery.gap`; in mV."""
        gap, best = self.findings.gap, self.findings.best
        base = gap.nearest
        return {
            "noise_mv": 1e3 * gap.noise_v,
            "known_mv": 1e3 * gap.known_v,
            "base_rmse_mv": 1e3 * base.rmse_v,
            "final_rmse_mv": 1e3 * best.rmse_v,
            "holdout_base_rmse_mv": 1e3 * base.held_rmse_v,
            "holdout_final_rmse_mv": 1e3 * best.held_rmse_v,
            "closed": closed(base.rmse_v, best.rmse_v, gap.floor_v),
            "holdout_closed": closed(base.held_rmse_v, best.held_rmse_v, gap.held_floor_v),
        }

    def _evidence(self) -> Json:
        return {
            "localisation": [asdict(place) for place in self.places_before],
            "localisation_after": [asdict(place) for place in self.places_after],
            "in_words": self.sentences,
            "capacity_ah": self.capacity_ah,
            "next_experiment": None if self.next_experiment is None else asdict(self.next_experiment),
            "closure": None if self.closure is None else asdict(self.closure),
            "backend_ranking": None if self.ranking is None else asdict(self.ranking),
            "temperature_rms_k": self.temperature_rms_k,
            "mesh_correction_mv": 1e3 * self.findings.mesh_v,
            "false_alarm_rate": RULES.false_alarm,
        }

    def _rationale(self, effect: Effect) -> str:
        text = super()._rationale(effect)
        if self.sentences:
            text += f" {self.sentences[0]}."
        ranked = self.ranking.ranked if self.ranking is not None else ()
        return text + "".join(f" Backend: {r.reason}" for r in ranked if r.key == effect.key)

    def _seen(self, explanation: Explanation | None, nomination: Nomination | None) -> Json:
        row: Json = {"score": None}
        if nomination is not None:
            order = {r.key: k for k, r in enumerate(self.ranking.ranked, start=1)} if self.ranking else {}
            row["score"] = None if nomination.score is None else asdict(nomination.score)
            row["backend_rank"] = order.get(nomination.effect.key)
        if explanation is None:
            return row | dict.fromkeys(("refit_rmse_mv", "bic", "holdout_rmse_mv"))
        return row | {
            "refit_rmse_mv": 1e3 * explanation.rmse_v,
            "bic": bic(explanation, self.findings.best),
            "holdout_rmse_mv": 1e3 * explanation.held_rmse_v,
            "temperature_rms_k": explanation.temperature_rms_k,
        }

    def _not_fitted(self, nomination: Nomination) -> str:
        if nomination.lacks:
            return nomination.lacks
        if nomination.screened is not None:
            return "a short fit gained less than others"
        if nomination.tried:
            return "could not be simulated at any strength from which a short fit starts"
        if nomination.gain <= 0:
            return "the score test predicts no gain in the allowed direction"
        return "the score test predicts less gain than for others"
