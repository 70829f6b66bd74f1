"""Where a run stands, as the agent may know it: the present trial, the latest attempt, and what memories tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...core.hooks import ProposeContext, Recollection
from ...core.prompt_sections import (
    ALIKE,
    CYCLES,
    FEEDBACK,
    LAST_ATTEMPT,
    MEMORY,
    PRIORS,
    SENSITIVITIES,
    TASK,
    TRIAL_FEATURES,
    TRIALS,
    numbered,
    section,
    table,
)
from ...core.protocol_text import written
from ...core.sensitivities import Sensitivities
from ...core.signals import Signal
from ...core.task import Experiment, Task
from ...core.trial import Trial, closest, repeated_by
from ..feedback.ageing import cycles_in_detail, measured_life
from ..feedback.rounding import SHOWN_DIGITS, rounded
from ..feedback.structured import SUCCESS

_NUMBER, _PARAMETER = "number", ("parameter", "now", "step")
_BOUNDS = ("lower", "upper")

_MEMORY_CHARS = 4500
"""Characters that each memory may take in the prompt."""


@dataclass(frozen=True, eq=False)
class Situation:
    """What the agent may know when it is asked."""

    context: ProposeContext  # Where the run stands.
    base: Trial  # The candidate to which changes apply: the closest so far.
    last: Trial | None  # The latest attempt, where it was no better.
    # What memories and priors tell, the most important last, where models read best.
    recollections: tuple[Recollection, ...]
    clipped: tuple[str, ...] = ()  # Parameters that the latest reply wanted beyond their bounds.
    look_at: tuple[int, ...] = ()  # Cycles of a long record that the latest reply asked for.
    failed: tuple[float, ...] = ()  # Lengths, in typical steps, of the latest changes from here that were no better.

    @classmethod
    def of(
        cls,
        context: ProposeContext,
        last: Trial | None = None,
        clipped: Sequence[str] = (),
        look_at: Sequence[int] = (),
        failed: Sequence[float] = (),
    ) -> Situation:
        """The situation of a run; what has the name of an attribute is that attribute."""
        base = closest([trial for trial in context.trials if trial.reduction is None] or context.trials)
        told = tuple(sorted(context.recall(_MEMORY_CHARS), key=lambda part: part.priority))
        return cls(context, base, None if last is base else last, told, tuple(clipped), tuple(look_at), tuple(failed))

    @property
    def task(self) -> Task:
        """What is to be matched."""
        return self.context.task

    @property
    def cycles(self) -> int:
        """Of a long record, how many cycles can be asked for; 0 of another."""
        return max(len(e.protocol or ()) for e in self.task.experiments) if self.task.long else 0

    @property
    def remembers(self) -> bool:
        """Whether any memory tells of earlier trials."""
        return any(part.title.startswith(MEMORY) for part in self.recollections)

    @cached_property
    def sensitivities(self) -> Sensitivities:
        """What the memories tell of the parameters' effects; empty if none does."""
        told = {part.title: part.content for part in self.recollections}
        return Sensitivities.read(told.get(SENSITIVITIES), tuple(self.base.feedback.numbers))

    @property
    def images(self) -> tuple[Path, ...]:
        """Those of the feedback: of the present trial, then of the latest attempt."""
        return (*self.base.feedback.images, *(self.last.feedback.images if self.last is not None else ()))

    def sections(self) -> list[str]:
        """The prompt's sections in the order in which they are read."""
        parts = [self.task_section()]
        told = ((part.title, self._told(part)) for part in self.recollections)
        parts += [section(title, content) for title, content in told if content]
        parts.append(section(FEEDBACK, self._feedback()))
        if self.task.long and self.base.curves and self.base.feedback.content.get("features"):
            shown = cycles_in_detail(self.task, self.base.curves, self.look_at)
            parts.append(section(CYCLES, {"trial": self.base.index, "records": rounded(shown)}))
        if self.last is not None and not self._remembered(self.last):
            parts.append(section(LAST_ATTEMPT, self._attempt(self.last)))
        return parts

    def standing(self) -> dict[str, Any]:
        """The present trial in a few numbers."""
        return {
            "trial": self.base.index,
            "simulations_left": self.context.simulations_left,
            **self._repeated(),
            **({"clipped_at_their_bounds_in_the_last_change": list(self.clipped)} if self.clipped else {}),
            **self._misfit(self.base),
        }

    def _repeated(self) -> dict[str, Any]:
        """Trials of the latest round whose values were simulated before, with the trial that they repeat."""
        latest = self.context.trials[-1]
        same_round = [t for t in self.context.trials if (t.phase, t.round) == (latest.phase, latest.round)]
        found = {
            str(trial.index): earlier.index
            for trial in same_round
            if trial.phase == "search" and (earlier := repeated_by(trial, self.context.trials)) is not None
        }
        return {"values_were_simulated_before_as_trial": found} if found else {}

    def _feedback(self) -> dict[str, Any]:
        told = self.base.feedback.told()
        # Without features the residuals are what is to become zero, and trials near each other must differ in them.
        shown = ("features", "residuals") if "features" in told else ()
        if told.get("events") == [SUCCESS]:
            # Its errors say so.
            told.pop("events")
        return {**self.standing(), **told, **{key: rounded(told[key], SHOWN_DIGITS) for key in shown}}

    def _remembered(self, trial: Trial) -> bool:
        """Whether the history tells a trial's values and features."""
        history = next((part.content for part in self.recollections if part.title == TRIALS), {})
        return trial.ok and f"trial_{trial.index}" in history.get(TRIAL_FEATURES, {})

    def _misfit(self, trial: Trial) -> dict[str, Any]:
        # With one number as feedback there is one number to tell.
        told = bool(trial.feedback.content.get("features")) and trial.residuals is not None
        return {"misfit_tolerances": float(f"{trial.misfit:.4g}")} if told else {}

    def _attempt(self, trial: Trial) -> dict[str, Any]:
        space = self.task.space
        steps = space.steps_between(self.base.candidate, trial.candidate)
        changes = {name: round(float(step), 3) for name, step in zip(space.names, steps, strict=True) if step}
        content = trial.feedback.content
        told = {key: content[key] for key in ("residuals", "events") if content.get(key)}
        now, then = self.base.feedback.numbers, trial.feedback.numbers
        if content.get("features"):
            told[TRIAL_FEATURES] = rounded([then.get(name) for name in now], SHOWN_DIGITS)
        return {"trial": trial.index, **self._misfit(trial), "changed_by_steps": changes, **told}

    def _told(self, part: Recollection) -> Mapping[str, Any]:
        """A memory's content, without what the table of parameters says: of the priors bounds, of effects names."""
        if part.title == PRIORS:
            return {key: value for key, value in part.content.items() if key != "bounds"}
        if part.title == SENSITIVITIES:
            by_number = {"effects", ALIKE}
            names = self.task.space.names
            return {k: numbered(v, names) if k in by_number else v for k, v in part.content.items()}
        return part.content

    def task_section(self, brief: bool = False) -> str:
        """What is simulated, what was measured, and where the parameters stand, each once; or the last alone."""
        task, cell = self.task, self.task.cell
        if brief:
            return section(TASK, {"parameters": self._parameters(numbers=False)})
        content = {
            **{"model": cell.model, "options": dict(cell.options)},
            **({"effects": list(cell.effects)} if cell.effects else {}),
            **({"parameter_set": str(cell.parameter_set)} if cell.parameter_set else {}),
            **_signals(task),
            "records": [_record(experiment, task) for experiment in task.experiments],
            "parameters": self._parameters(self.remembers),
        }
        return section(TASK, content)

    def _parameters(self, numbers: bool) -> dict[str, Any]:
        priors = next((part.content for part in self.recollections if part.title == PRIORS), {})
        bounds = priors.get("bounds")
        bounds = bounds if isinstance(bounds, Mapping) else {}
        rows = [
            ([number] if numbers else [])
            + [parameter.name, self.base.candidate[parameter.name], parameter.typical_step]
            + ([*bounds.get(parameter.name, (None, None))] if bounds else [])
            for number, parameter in enumerate(self.task.space, start=1)
        ]
        columns = [*([_NUMBER] if numbers else []), *_PARAMETER, *(_BOUNDS if bounds else ())]
        return table(columns, rounded(rows))

    def room(self) -> tuple[np.ndarray, np.ndarray]:
        """How many typical steps each parameter may fall and rise, shapes (p,)."""
        lower = [p.in_steps(p.lower) - p.in_steps(self.base.candidate[p.name]) for p in self.task.space]
        upper = [p.in_steps(p.upper) - p.in_steps(self.base.candidate[p.name]) for p in self.task.space]
        return np.array(lower), np.array(upper)


def _signals(task: Task) -> dict[str, Any]:
    """What the agent cannot know of the signals."""
    if not task.domain.signals_told and task.signals == task.domain.signals:
        return {}

    def told(signal: Signal) -> dict[str, Any]:
        tolerance = {"tolerance": signal.tolerance} if signal.role == "observed" else {}
        return {"role": signal.role, "unit": signal.unit, **tolerance}

    return {"signals": {signal.name: told(signal) for signal in task.signals}}


def _record(experiment: Experiment, task: Task) -> dict[str, Any]:
    protocol = experiment.protocol
    if protocol is None:
        driven = [signal.words for signal in task.driven if signal.name in experiment.target.signals]
        told: Any = f"measured {' and '.join(driven) or 'conditions'}"
    elif len(set(protocol)) == 1 < len(protocol):
        told = {"times": len(protocol), "cycle": list(protocol[0])}
    else:
        told = written(protocol)
    if experiment.long:
        return {"name": experiment.name, "protocol": told, "measured": measured_life(experiment)}
    return {"name": experiment.name, "protocol": told, "scored_cycle": experiment.scored_cycle or "all"}
