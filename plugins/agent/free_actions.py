"""Answers to what the agent may ask without a simulation: a linear prediction, a step's curve."""

from pathlib import Path
from typing import Any

import numpy as np

from ...core.prompt_sections import section, table
from ..feedback.overlay import draw_step
from ..feedback.rounding import rounded
from ..feedback.steps import curves, named_steps
from .actions import Action
from .linear_advice import predicted, suggested
from .situation import Situation
from .updates import apply_updates

_POINTS = 13
"""Points of a curve: every twelfth of a step's duration."""

_DECIMALS = 6
"""Decimals of a curve's values: what is smaller is the solver's."""


def answer(action: Action, situation: Situation) -> str:
    """The answer to a `predict` or a `look`, as a section of a prompt."""
    if action.kind == "look":
        return section(f"Step {action.step} of trial {situation.base.index}", _curves(action.step, situation))
    if action.candidates:
        return section("Prediction", predicted(situation, action.candidates[0]))
    change = suggested(situation)
    promised = {"note": "no effects are known"}
    if change:
        promised = predicted(situation, apply_updates(change, situation.task.space, situation.base.candidate)[0])
    return section("Suggested change", {"updated_params": change, **promised})


def picture(action: Action, situation: Situation) -> tuple[Path, ...]:
    """The step of a `look` as a picture beside those of the feedback; none where the feedback has none."""
    pictures = situation.base.feedback.images
    if action.kind != "look" or not pictures:
        return ()
    pair, experiment = named_steps(situation.task, situation.base.curves)[action.step]
    path = pictures[0].with_name(f"trial-{situation.base.index:03d}-{action.step}.png")
    draw_step(pair, situation.task.compared(pair.step.kind, experiment), path)
    return (path,)


def steps_to_look_at(situation: Situation) -> tuple[str, ...]:
    """The steps whose curves may be seen; none where the feedback is a number."""
    if "steps" not in situation.base.feedback.content or not situation.base.curves:
        return ()
    return tuple(named_steps(situation.task, situation.base.curves))


def _curves(name: str, situation: Situation) -> dict[str, Any]:
    pair, experiment = named_steps(situation.task, situation.base.curves)[name]
    measured_s, simulated_s = pair.duration_s
    fractions = np.linspace(0.0, 1.0, _POINTS)
    content: dict[str, Any] = {"measured_s": measured_s, "simulated_s": simulated_s}
    for signal in situation.task.compared(pair.step.kind, experiment):
        found = curves(pair, signal, fractions)
        unit = "pct" if signal.relative else signal.shown
        heads = ["at_pct", f"measured_{signal.unit}", f"simulated_{signal.unit}", f"residual_{unit}"]
        rows = zip((100.0 * fractions).tolist(), *(values.tolist() for values in found.values()), strict=True)
        content[signal.name] = table(heads, [[round(value, _DECIMALS) for value in row] for row in rows])
    return rounded(content, 5)  # type: ignore[no-any-return]
