"""Which action to take beside a numerical fit: leave it alone while it gets on, step in where it is stuck."""

from __future__ import annotations

from typing import Any

from .reading import Prompt
from .reasoner import propose

_GETS_ON = 0.8
"""A fit whose misfit fell below this share of what it was some rounds ago is left alone."""

_ROUNDS_BACK = 4
_PATIENCE = 8
_TRIP = 30
"""Simulations for a trip once the fit beside has ended."""


def act(prompt: Prompt) -> dict[str, Any]:
    """A reply to the hybrid's prompt."""
    status = prompt.numerics.get("status", "")
    allowance = int(prompt.numerics.get("you_may_spend") or 1)
    if status == "infeasible":
        return _reply(
            "Nothing could be simulated yet; polarisation exhausts the cell before the record ends.",
            "The cell is harsher than the model can bear.",
            "ease",
            "A gentler cell first: smaller particles, more pores.",
            simulations=allowance,
        )
    if status == "done":
        return _after_the_end(prompt)
    if _gets_on(prompt) or _last(prompt) == "set":
        return _let_it(prompt)
    return {**propose(prompt), "action": "set", "simulations": 1}


def _gets_on(prompt: Prompt) -> bool:
    misfits = [float(value) for value in prompt.numerics.get("misfit_by_round", ()) if value is not None]
    return len(misfits) <= _ROUNDS_BACK or misfits[-1] < _GETS_ON * misfits[-1 - _ROUNDS_BACK]


def _last(prompt: Prompt) -> str:
    actions = prompt.numerics.get("your_last_actions") or [{}]
    return str(actions[-1].get("action", ""))


def _let_it(prompt: Prompt) -> dict[str, Any]:
    reason = "The fit gets on" if _gets_on(prompt) else "The last value set by hand was no help"
    return _reply(
        f"{reason}; its misfit is {prompt.numerics.get('misfit_tolerances')} tolerances.{_said_by_the_record(prompt)}",
        "The parameters are off together, and the slopes say by how much.",
        "refine",
        "Let it go on.",
        simulations=_PATIENCE,
    )


def _said_by_the_record(prompt: Prompt) -> str:
    """What is fixed, open and moves together, in a sentence; empty while no slopes are known."""
    record = prompt.numerics.get("the_record")
    if not isinstance(record, dict):
        return ""
    text = f" The record fixes {len(record.get('fixes', ()))} of {len(prompt.parameters)} parameters here"
    if record.get("leaves_open"):
        text += f", leaves open {', '.join(map(str, record['leaves_open']))}"
    groups = [" with ".join(map(str, group)) for group in record.get("only_together", ())]
    return text + (f", and moves {'; '.join(groups)} only together." if groups else ".")


def _after_the_end(prompt: Prompt) -> dict[str, Any]:
    """The fit ended far from the record: first what eases, then fresh slopes, then the values the features ask for."""
    tried = [str(entry.get("action", "")) for entry in prompt.numerics.get("your_last_actions", ())]
    if "ease" not in tried:
        return _reply(
            "The fit has ended far from the record: a trap, as where a step has vanished.",
            "A step that vanished hides what the parameters do.",
            "ease",
            "Bring it back with a gentler cell, match the rest, then everything.",
            simulations=_TRIP,
        )
    if tried[-1] != "jacobian" and tried.count("jacobian") < 2:
        return _reply(
            "The fit has ended, and what it believes of the parameters may be wrong here.",
            "The slopes have changed on the way.",
            "jacobian",
            "Measure them again and go on from the best point.",
            simulations=_TRIP,
        )
    if tried.count("set") < 2:
        return {**propose(prompt), "action": "set", "simulations": 1}
    return _reply(
        "Nothing tried since the fit ended was better.",
        "What is left is beyond these parameters.",
        "refine",
        "Leave it at that.",
        simulations=1,
    )


def _reply(analysis: str, hypothesis: str, action: str, rationale: str, simulations: int) -> dict[str, Any]:
    return {
        "analysis": analysis,
        "hypothesis": hypothesis,
        "action": action,
        "simulations": max(simulations, 1),
        "rationale": rationale,
    }
