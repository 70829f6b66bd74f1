"""The answer of a discovery over a life."""

from dataclasses import asdict, dataclass, field
from typing import ClassVar

from ..inference.drift import Drift
from ..parameters import Candidate
from .discovery import Discovery, Json
from .explanation import Explanation
from .findings import Nomination
from .life import DEVIATION_V, LIFE_RULES
from .rules import closed


@dataclass(eq=False)
class LifeDiscovery(Discovery):
    """Which mechanism ages a cell."""

    rules = LIFE_RULES
    noun = "mechanism"
    explained = "how the cell ages"
    nothing = "The cell does not age by more than the scatter of its cycles"
    told: ClassVar = {
        "Fitted cycles [standard deviations]": ("base_error", "final_error"),
        "Later cycles [standard deviations]": ("later_base_error", "later_final_error"),
    }

    modes: tuple[Drift, ...]  # Lithium, active material and resistance by cycle, whatever the mechanism.
    fit_cycles: int  # The last cycle that was fitted.
    cell: Candidate  # The cell's own parameters, fitted to its first cycle.
    tried: tuple[str, ...] = field(default=(), kw_only=True)  # Keys of the mechanisms that were fitted to the life.

    @property
    def _tried(self) -> int:
        return len(self.tried)

    @property
    def parameters(self) -> dict[str, float]:
        """See `Discovery.parameters`."""
        return {**self.cell, **super().parameters}

    @property
    def gap(self) -> dict[str, float]:
        """See `Discovery.gap`; in standard deviations of the residuals."""
        base, best = self.findings.base, self.findings.best
        return {
            "base_error": base.rmse_v / DEVIATION_V,
            "final_error": best.rmse_v / DEVIATION_V,
            "later_base_error": base.held_rmse_v / DEVIATION_V,
            "later_final_error": best.held_rmse_v / DEVIATION_V,
            "closed": closed(base.rmse_v, best.rmse_v, DEVIATION_V),
            "later_closed": closed(base.held_rmse_v, best.held_rmse_v, DEVIATION_V),
        }

    def _evidence(self) -> Json:
        modes = [asdict(mode) for mode in self.modes]
        return {"fit_cycles": self.fit_cycles, "tried": list(self.tried), "modes": modes}

    def _seen(self, explanation: Explanation | None, nomination: Nomination | None) -> Json:
        if explanation is None:
            return dict.fromkeys(("error", "later_error"))
        return {"error": explanation.rmse_v / DEVIATION_V, "later_error": explanation.held_rmse_v / DEVIATION_V}
