"""Asking a model for an object until it passes a check, a few times at most."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from ...core.contracts.reply_parsing import parse_object
from ...core.errors import BsaError
from ...core.messages import UNUSABLE, Backend, BackendFailure, JsonSchema, Message, Reply, ReplyRefused
from ...core.printable import counted
from ...core.proposal import NO_REPLY

T = TypeVar("T")

ATTEMPTS = 3

_REPLY_CHARS = 4000
"""Characters of an earlier reply that are shown to the model again."""


@dataclass(frozen=True)
class Answer(Generic[T]):
    """What came of asking."""

    value: T | None  # What the check made of the reply; None if no reply passed.
    problems: tuple[str, ...]  # What was wrong with the replies that did not pass, in order.
    reply: Reply | None  # The last reply, if there was one.

    @property
    def complaint(self) -> str:
        """What was wrong, each thing once with the number of attempts."""
        counts = Counter(self.problems)
        return "; ".join(f"{what} ({counted(n, 'attempt')})" if n > 1 else what for what, n in counts.items())


def ask(
    backend: Backend,
    messages: Sequence[Message],
    schema: JsonSchema,
    check: Callable[[Mapping[str, Any]], T],
    seed: int,
) -> Answer[T]:
    """Ask, check, and ask again with the error, at most `ATTEMPTS` times.

    A call that the backend gives up on ends the asking: it has retried already.
    """
    conversation = list(messages)
    problems: list[str] = []
    reply: Reply | None = None
    for attempt in range(ATTEMPTS):
        try:
            reply = backend.complete(conversation, schema, seed=seed + attempt)
        except ReplyRefused as refusal:
            reply, problem = refusal.reply, str(refusal)
        except BackendFailure as failure:
            problems.append(f"{NO_REPLY}: {failure}")
            break
        else:
            problems.extend(reply.rejected)
            try:
                return Answer(check(parse_object(reply.text, schema.get("properties", ()))), tuple(problems), reply)
            except BsaError as error:
                problem = str(error)
        problems.append(problem)
        complaint = f"{UNUSABLE} {problem} Answer again with one valid JSON object."
        conversation = answered(conversation, reply.text, complaint)
    return Answer(None, tuple(problems), reply)


def answered(conversation: Sequence[Message], reply: str, answer: str, images: tuple[Path, ...] = ()) -> list[Message]:
    """The conversation with a reply, shortened, and an answer to it."""
    return [*conversation, Message("assistant", reply[:_REPLY_CHARS]), Message("user", answer, images)]
