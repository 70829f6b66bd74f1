"""Merges several independent replies into one (``--votes N``)."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any, Literal

from ..core.contracts.reply_parsing import parse_object
from ..core.errors import BsaError
from ..core.messages import Backend, JsonSchema, Message, Reply, StructuredBy, Usage
from ..core.proposal import is_change
from ..core.run.recording import VOTE, BackendAround, Recorder
from .structured_output import LADDER

UPDATES, ACTION = "updated_params", "action"
RULE = (
    "of the replies that ask for the commonest action, parameters named by more than half (else most named) are "
    "kept, each with the median of its changes of the commonest kind, factors on a log scale; all other words are "
    "those of the reply closest to that"
)
_SEED_STRIDE = 100_003

Kind = Literal["factor", "difference", "value"]


@dataclass(frozen=True)
class Change:
    """One change, on the scale on which it is averaged."""

    kind: Kind  # ``"*1.2"``, ``"+0.02"`` or an absolute value.
    amount: float  # Logarithm of a factor; the number itself otherwise.

    @classmethod
    def read(cls, written: Any) -> Change | None:
        """The change, or None if it is not one."""
        text = str(written).strip()
        if isinstance(written, bool) or not (is_change(text) or isinstance(written, (int, float))):
            return None
        if text.startswith("*"):
            factor = float(text[1:])
            return cls("factor", math.log(factor)) if 0 < factor < math.inf else None
        amount = float(text)
        if not math.isfinite(amount):
            return None
        return cls("difference" if isinstance(written, str) and text[0] in "+-" else "value", amount)

    def __str__(self) -> str:
        if self.kind == "factor":
            return f"*{math.exp(self.amount):.6g}"
        return f"{self.amount:+.6g}" if self.kind == "difference" else f"{self.amount:.6g}"

    @property
    def written(self) -> str | float:
        """As a reply has it: an absolute value is a number, for as text a negative one would be a difference."""
        return float(str(self)) if self.kind == "value" else str(self)

    def distance(self, other: Change | None) -> float:
        """How far apart two changes are: logarithms or relative differences; 1 for different kinds."""
        if other is None or other.kind != self.kind:
            return 1.0
        gap = abs(self.amount - other.amount)
        return gap if self.kind == "factor" else gap / max(abs(self.amount), abs(other.amount), 1e-300)


@dataclass(frozen=True)
class Ballot:
    """What one reply voted for."""

    content: Mapping[str, Any]  # The reply as an object; empty if it could not be read.
    changes: Mapping[str, Change]
    problem: str = ""  # Why it does not count, if it does not.

    @classmethod
    def read(cls, text: str, schema: JsonSchema) -> Ballot:
        """The ballot of a reply."""
        try:
            content = parse_object(text, schema.get("properties", ()))
        except BsaError as error:
            return cls({}, {}, error.message)
        changes = _changes(content)
        return cls(content, changes, "" if changes or content.get(ACTION, "set") != "set" else "it changes nothing")

    @property
    def action(self) -> str:
        """What kind of move the reply asks for."""
        return str(self.content.get(ACTION, "set"))

    def as_json(self) -> dict[str, Any]:
        """For the journal."""
        return {
            "changes": {name: str(change) for name, change in self.changes.items()},
            "action": self.action,
            "problem": self.problem,
        }


class VotingBackend(BackendAround):
    """Asks another backend several times, with a different seed for each vote, and merges the replies."""

    def __init__(self, inner: Backend, votes: int, recorder: Recorder | None = None) -> None:
        super().__init__(inner)
        self._votes = votes
        self._recorder = recorder
        self.name = f"{inner.name}, {votes} votes"

    def recorded_by(self, recorder: Recorder) -> VotingBackend:
        """See `bsa.core.run.recording.Layer`: every reply is recorded, and what each voted for."""
        return VotingBackend(recorder.around(self._inner), self._votes, recorder)

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `bsa.core.messages.Backend.complete`."""
        if UPDATES not in schema.get("properties", {}):
            # A set of perturbations to try is no opinion: there is nothing to average.
            return self._inner.complete(messages, schema, seed=seed)
        replies = [
            self._inner.complete(messages, schema, seed=seed + vote * _SEED_STRIDE) for vote in range(self._votes)
        ]
        ballots = [Ballot.read(reply.text, schema) for reply in replies]
        merged = merge(ballots)
        useless = [f"vote {number}: {ballot.problem}" for number, ballot in enumerate(ballots, 1) if ballot.problem]
        weakest: StructuredBy = max((reply.structured_by for reply in replies), key=LADDER.index)
        notes = [f"vote {number}: {note}" for number, reply in enumerate(replies, 1) for note in reply.notes]
        result = replace(
            replies[0],
            text=replies[0].text if merged is None else json.dumps(merged, ensure_ascii=False),
            usage=sum((reply.usage for reply in replies), Usage()),
            structured_by=weakest,
            notes=tuple(notes),
            rejected=tuple(useless if merged is not None else useless[1:]),  # the first is refused as the merged reply
        )
        if self._recorder is not None:
            told = [ballot.as_json() for ballot in ballots]
            self._recorder.record(VOTE, text=result.text, ballots=told, rejected=list(result.rejected), rule=RULE)
        return result


def merge(ballots: Sequence[Ballot]) -> dict[str, Any] | None:
    """One reply out of many; None if none of them counts."""
    valid = [ballot for ballot in ballots if not ballot.problem]
    if not valid:
        return None
    action = Counter(ballot.action for ballot in valid).most_common(1)[0][0]
    valid = [ballot for ballot in valid if ballot.action == action]
    voted = [ballot for ballot in valid if ballot.changes]
    if not voted:
        # What else an action needs (a step, a list of candidates) has no middle.
        return dict(valid[0].content)
    valid = voted
    winner = _winner([ballot.changes for ballot in valid])
    closest = min(valid, key=lambda ballot: _distance(winner, ballot.changes))
    return {**closest.content, UPDATES: {name: change.written for name, change in winner.items()}}


def _changes(content: Mapping[str, Any]) -> dict[str, Change]:
    updates = content.get(UPDATES)
    if not isinstance(updates, Mapping):
        return {}
    read = {str(name): Change.read(written) for name, written in updates.items()}
    return {name: change for name, change in read.items() if change is not None}


def _winner(ballots: Sequence[Mapping[str, Change]]) -> dict[str, Change]:
    named = Counter(name for changes in ballots for name in changes)
    threshold = min(len(ballots) // 2 + 1, max(named.values()))
    winner: dict[str, Change] = {}
    for name in [name for name, count in named.items() if count >= threshold]:
        found = [changes[name] for changes in ballots if name in changes]
        kind = Counter(change.kind for change in found).most_common(1)[0][0]
        winner[name] = Change(kind, median(change.amount for change in found if change.kind == kind))
    return winner


def _distance(winner: Mapping[str, Change], changes: Mapping[str, Change]) -> float:
    missing = sum(name not in winner for name in changes)
    return missing + sum(change.distance(changes.get(name)) for name, change in winner.items())
