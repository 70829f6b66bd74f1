"""Calls of the language model as a journal tells them, and what votes or a reviewer made of their replies."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from ..core.messages import Usage
from ..core.run.recording import LOST_CALL, REPLY, REVIEW, VOTE

EXCHANGED = (REPLY, LOST_CALL, VOTE, REVIEW)
"""Events that are exchanges."""


@dataclass(frozen=True)
class Turn:
    """One message of a prompt."""

    role: str  # Who speaks.
    text: str  # What is said. Untrusted.
    images: int = 0  # How many images went with it.


@dataclass(frozen=True)
class Exchange:
    """One call of the language model, or what votes or a reviewer made of its reply."""

    prompt: tuple[Turn, ...]  # What it was shown; empty for votes and reviews.
    text: str = ""  # What it answered, untrusted; empty for a lost call.
    lost: str = ""  # Why there was no answer, if there was none.
    model: str = ""  # As in `Reply`.
    notes: tuple[str, ...] = ()  # What the backend did on the way.
    usage: Usage = field(default_factory=Usage)  # What it cost.
    made_by: Literal["model", "vote", "review"] = "model"  # Who the text is from.


def exchange_of(event: Mapping[str, Any]) -> Exchange:
    """What an event of one of `EXCHANGED` tells."""
    if event["event"] == VOTE:
        notes = [_ballot_words(number, ballot) for number, ballot in enumerate(event["ballots"], 1)]
        return Exchange((), text=event["text"], notes=(event["rule"], *notes), made_by="vote")
    if event["event"] == REVIEW:
        return Exchange((), text=event["text"], notes=(_VERDICTS[event["verdict"]],), made_by="review")
    prompt = tuple(Turn(turn["role"], turn["text"], turn["images"]) for turn in event["prompt"])
    if event["event"] == LOST_CALL:
        return Exchange(prompt, lost=event["reason"] or "no reason given")
    return Exchange(
        prompt,
        text=event["text"],
        model=event["model"],
        notes=tuple(event["notes"]),
        usage=Usage(**event["usage"]),
    )


_VERDICTS = {
    "accept": "The reviewer accepted the reply.",
    "edit": "The reviewer edited the reply; above is what was tried.",
    "refuse": "The reviewer refused the reply; above is the reason.",
}


def _ballot_words(number: int, ballot: Mapping[str, Any]) -> str:
    if ballot["problem"]:
        return f"Reply {number} does not count: {ballot['problem']}"
    changes = ", ".join(f"{name} {change}" for name, change in ballot["changes"].items())
    return f"Reply {number} votes for {changes}"
