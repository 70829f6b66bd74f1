"""The replies of an earlier run, given again without a model."""

import shlex
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import Any

from ..core.errors import BsaError
from ..core.messages import BackendFailure, BudgetSpent, JsonSchema, Message, PromptRefused, Reply, ReplyRefused, Usage
from ..core.run.budget import BUDGET, with_budget
from ..core.run.journal import FILE_NAME, read_events
from ..core.run.recording import LOST_CALL, REPLY, REVIEW, VOTE, is_outcome
from .reviewing import Verdict


class ReplayBackend:
    """Gives again, in order, what the proposer of a run was given: votes merged, and refusals.

    Tokens and cost are the original run's, so that its report comes out the same.
    """

    sees_images = False

    def __init__(self, events: Iterable[Mapping[str, Any]], name: str, more: str = "") -> None:
        self.name = name
        self._more = more  # How there come to be more of them, in sentences.
        self._given = deque(given(events))
        self._count = len(self._given)

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `bsa.core.messages.Backend.complete`.

        Raises `BudgetSpent` when no reply is left, so that the run stops cleanly where the original did.
        """
        if not self._given:
            raise BudgetSpent(f"all {self._count} replies of {self.name} have been given", self._more)
        found = self._given.popleft()
        if isinstance(found, BackendFailure):
            raise found
        return found

    def pass_over(self) -> None:
        """See `bsa.core.messages.GivesInOrder.pass_over`."""
        if self._given:
            self._given.popleft()

    def close(self) -> None:
        """Nothing to release."""


def given(events: Iterable[Mapping[str, Any]]) -> list[Reply | BackendFailure]:
    """What the proposer of a run was given, in order; of votes their outcome, with what they cost together."""
    found: list[Reply | BackendFailure] = []
    asked: list[Any] = []  # The prompts of the last replies, where they may be votes that nothing was made of yet.
    merges = False
    for event in events:
        kind, text = event["event"], str(event.get("text", ""))
        last = found[-1] if found else None
        merges = merges or _merges(event)
        if kind == REPLY:
            found.append(_reply(event, text))
            asked += [event.get("prompt")] * merges
            continue
        if kind == VOTE and isinstance(last, Reply):
            count = max(len(event.get("ballots", ())), 1)
            votes = [reply for reply in found[-count:] if isinstance(reply, Reply)]
            usage = sum((vote.usage for vote in votes), Usage())
            found[-count:] = [replace(last, text=text, usage=usage, rejected=tuple(event.get("rejected", ())))]
        elif kind == REVIEW and isinstance(last, Reply):
            try:
                found[-1] = Verdict(event.get("verdict", "accept"), text).on(last)
            except ReplyRefused as refusal:
                found[-1] = refusal
        elif kind == LOST_CALL and is_outcome(event):
            # Votes on the prompt that was then refused were not handed on.
            del found[len(found) - _alike(asked, event.get("prompt")) :]
            found.append(PromptRefused(str(event.get("reason", ""))))
        elif kind != "proposal":
            continue
        asked = []
    # Nor were those with which a run ended before it had all of them.
    return found[: len(found) - _alike(asked, asked[-1])] if asked else found


def _merges(event: Mapping[str, Any]) -> bool:
    """Whether an event begins a run with several votes a round."""
    return int(event.get("config", {}).get("backend_options", {}).get("votes") or 1) > 1


def _alike(prompts: Sequence[Any], prompt: Any) -> int:
    """How many of the last prompts are this one."""
    return sum(1 for _ in takewhile(lambda other: other == prompt, reversed(prompts)))


def _reply(event: Mapping[str, Any], text: str) -> Reply:
    usage = {key: value for key, value in event.get("usage", {}).items() if key in Usage.__dataclass_fields__}
    return Reply(
        text=text,
        usage=Usage(**usage),
        model=str(event.get("model", "")),
        structured_by=event.get("structured_by", "text"),
        notes=tuple(event.get("notes", ())),
    )


def replay(run: str) -> ReplayBackend:
    """The replies of a run's journal, by its folder, the journal itself, or its name below ``runs/``.

    Raises `BsaError` if there is no such run, or it asked no model.
    """
    given = Path(run)
    folder = given.parent if given.name == FILE_NAME else given
    if not (folder / FILE_NAME).is_file() and ("runs" / given / FILE_NAME).is_file():
        folder = "runs" / given
    events = list(read_events(folder))
    backend = ReplayBackend(events, f"replay:{run}", _how_to_have_more(folder, events))
    if not backend._count:
        raise BsaError(f"the run {folder} holds no reply of a model.", "replay a run whose scaffold asks one.")
    return backend


def _how_to_have_more(folder: Path, events: Sequence[Mapping[str, Any]]) -> str:
    """How a run comes by more replies, in sentences: one that its budget ended, or that was stopped, can go on."""
    own = "A model goes on in a run of its own, with --backend NAME."
    ends = [event for event in events if event["event"] in ("end", BUDGET)]
    allowed = with_budget(events[0].get("config", {}), events).get("simulations")
    if (ends and ends[-1].get("status") in ("finished", "converged")) or not isinstance(allowed, int):
        return f"The repeated run had ended by itself there. {own}"
    go_on = f"bsa-run --resume {shlex.quote(str(folder))} --simulations {2 * allowed}"
    return f"First let the repeated run go on ({go_on}), then resume this one. {own}"
