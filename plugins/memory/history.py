"""The per-round memory: what was tried, why, and what came of it."""

from __future__ import annotations

import json
from typing import Any

from pydantic import BaseModel, Field

from ...core.hooks import Recollection, RunContext, hookimpl
from ...core.prompt_sections import TRIALS
from ...core.proposal import Proposal
from ...core.trial import Trial
from ..feedback.rounding import rounded


class HistoryOptions(BaseModel, extra="forbid"):
    """What the per-round memory shows."""

    rounds: int = Field(24, ge=1, description="Trials shown at most: the best ones and the latest ones.")


class HistoryMemory:
    """Shows earlier trials as a table: parameter values, features, errors and hypotheses.

    The best trials and the latest ones are shown; warm-up trials are left to the sensitivity memory.
    """

    def __init__(self, options: HistoryOptions, context: RunContext) -> None:
        self._options = options
        self._names = context.task.space.names
        self._rows: list[dict[str, Any]] = []
        self._objectives: list[float] = []

    @hookimpl
    def remember(self, trial: Trial, proposal: Proposal | None) -> None:
        """See `RunHooks.remember`."""
        # An reduced simulation has no place in a table of fits.
        if trial.phase == "warm-up" or trial.reduction is not None:
            return
        content = trial.feedback.content
        row: dict[str, Any] = {
            "trial": trial.index,
            "values": [trial.candidate[name] for name in self._names],
            **content.get("residuals", {}),
        }
        if "features" in content:
            row["features"] = list(content["features"].values()) if trial.ok else "incomplete"
            self._feature_names = list(content["features"]) if trial.ok else getattr(self, "_feature_names", [])
        if not trial.ok:
            row["events"] = list(content.get("events", ()))
        if proposal is not None and proposal.hypothesis:
            row["hypothesis"] = proposal.hypothesis[:160]
        self._rows.append(rounded(row, digits=5))
        self._objectives.append(trial.objective)

    @hookimpl
    def recall(self, budget: int) -> Recollection | None:
        """See `RunHooks.recall`."""
        if not self._rows:
            return None
        count = min(self._options.rounds, len(self._rows))
        while True:
            content = {
                "parameters": list(self._names),
                "features": getattr(self, "_feature_names", []),
                "trials": [self._rows[place] for place in self._shown(count)],
            }
            if count <= 1 or len(json.dumps(content)) <= budget:
                return Recollection(TRIALS, content, priority=2)
            count -= 1

    def _shown(self, count: int) -> list[int]:
        """The places of the best half and the latest half, in order of time."""
        places = range(len(self._rows))
        best = sorted(places, key=lambda place: self._objectives[place])[: (count + 1) // 2]
        latest = [place for place in reversed(places) if place not in best][: count - len(best)]
        return sorted([*best, *latest])
