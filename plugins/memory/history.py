"""The per-round memory: what was tried, why, and what came of it."""

import json
from typing import Any

from pydantic import BaseModel, Field

from ...core.hooks import Recollection, RunContext, hookimpl
from ...core.prompt_sections import TRIAL_FEATURES, TRIALS, table
from ...core.proposal import FIT, Proposal
from ...core.trial import Trial, closest
from ..feedback.rounding import SHOWN_DIGITS, rounded

_NOTE_CHARS = 40
"""Characters of the note on a trial, at most."""

_STEP_DECIMALS = 2
"""Decimals of a change, in typical steps."""

_MOST_STEPS = 72
"""Numbers that the changes of all trials shown may take: six trials of twelve parameters. Of twenty parameters a reader
gains more from their effects."""


class HistoryOptions(BaseModel, extra="forbid"):
    """What the per-round memory shows."""

    rounds: int = Field(6, ge=1, description="Trials shown at most: the closest ones and the latest ones.")


class HistoryMemory:
    """Shows earlier trials as tables: parameter values, errors, who asked for them and why, and the latest features.

    Values are told in typical steps above those of the closest trial, as the sensitivities are.
    """

    def __init__(self, options: HistoryOptions, context: RunContext) -> None:
        self._options = options
        self._space = context.task.space
        self._trials: list[Trial] = []
        self._notes: list[tuple[str, str]] = []
        self._proposal: Proposal | None = None
        self._place = 0

    @hookimpl
    def remember(self, trial: Trial, proposal: Proposal | None) -> None:
        """See `RunHooks.remember`."""
        self._place = self._place + 1 if proposal is self._proposal else 0
        self._proposal = proposal
        # A simulation of another task has no place in a table of fits.
        if trial.reduction is None:
            self._trials.append(trial)
            self._notes.append((_author(trial, proposal, self._place), self._note(trial, proposal)))

    @hookimpl
    def recall(self, budget: int) -> Recollection | None:
        """See `RunHooks.recall`."""
        # The start alone is the present trial, which the feedback tells.
        if len(self._trials) < 2:
            return None
        most = min(self._options.rounds, len(self._trials), max(_MOST_STEPS // len(self._space), 2))
        for count in range(most, 0, -1):
            content = self._content(self._shown(count))
            if len(json.dumps(content)) <= budget:
                break
        return Recollection(TRIALS, content, priority=2)

    def _content(self, places: list[int]) -> dict[str, Any]:
        now = closest(self._trials)
        # The misfit decides where there are features; another error would be a second opinion.
        told = any(trial.misfit < float("inf") for trial in self._trials) and bool(now.feedback.content.get("features"))
        errors = [] if told else list(now.feedback.content.get("residuals", {}))[:1]
        noted = any(self._notes[place][1] for place in places)
        rows = []
        for place in places:
            trial, (author, note) = self._trials[place], self._notes[place]
            steps = self._space.steps_between(now.candidate, trial.candidate)
            residuals = trial.feedback.content.get("residuals", {})
            told_errors = [*([trial.misfit] * told), *(residuals.get(name) for name in errors)]
            told_steps = [round(float(step), _STEP_DECIMALS) for step in steps]
            rows.append([trial.index, author, *told_errors, told_steps, *[note] * noted])
        columns = ["trial", "asked_by", *["misfit_tolerances"] * told, *errors, "steps_from_present", *["note"] * noted]
        content: dict[str, Any] = {
            "meaning": f"steps_from_present: from trial {now.index}, in the task's order",
            "trials": rounded(table(columns, rows), SHOWN_DIGITS),
        }
        # What a fit beside asked for is in the learnt sensitivities; the agent's own attempts are told.
        own = [self._trials[place] for place in places if self._notes[place][0] != FIT]
        latest = [trial for trial in own if trial.ok and trial is not now]
        names = list(now.feedback.content.get("features", {}))
        if names and latest:
            # Their names stand in the feedback.
            features = [latest[-1].feedback.numbers.get(name) for name in names]
            content[TRIAL_FEATURES] = {f"trial_{latest[-1].index}": rounded(features, SHOWN_DIGITS)}
        return content

    def _note(self, trial: Trial, proposal: Proposal | None) -> str:
        """Why a trial failed, or what the first one of a proposal was to show."""
        if not trial.ok:
            return "; ".join(map(str, trial.feedback.content.get("events", ())))[:_NOTE_CHARS]
        return proposal.hypothesis[:_NOTE_CHARS] if proposal is not None and self._place == 0 else ""

    def _shown(self, count: int) -> list[int]:
        """The places of the closest half and the latest half, in order of time."""
        places = range(len(self._trials))
        best = sorted(places, key=lambda place: (self._trials[place].misfit, self._trials[place].objective))
        best = best[: (count + 1) // 2]
        latest = [place for place in reversed(places) if place not in best][: count - len(best)]
        return sorted([*best, *latest])


def _author(trial: Trial, proposal: Proposal | None, place: int) -> str:
    """Who asked for a trial: the phase, or what the proposer says of the candidate at that place."""
    authors = proposal.details.get("authors") if proposal is not None else None
    if isinstance(authors, (list, tuple)) and place < len(authors):
        return str(authors[place])
    return trial.phase
