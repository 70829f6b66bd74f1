"""What is asked of the language model and what comes of it, written into the journal and on resume taken from there."""

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, Protocol, runtime_checkable

from ..errors import BsaError
from ..messages import (
    Backend,
    BackendFailure,
    BackendUnreachable,
    BudgetSpent,
    GivesInOrder,
    JsonSchema,
    Message,
    Outage,
    PromptRefused,
    PromptTooLong,
    Reply,
    TellsMeanwhile,
    Usage,
)
from ..redaction import redact
from .allowance import UNLIMITED, Allowance
from .journal import Journal

REPLY, LOST_CALL, VOTE, REVIEW = "reply", "lost-call", "vote", "review"

ASK_AGAIN_AFTER_S = (5.0, 30.0, 120.0)
"""Waits before a lost call is made again, s.

A server that is restarted has its model loaded after a minute or two. A longer outage needs a person, and a stopped
run holds neither memory nor a place at the server until then.
"""

MOST_REFUSED = 3
"""So many prompts refused in a row stop the run: the next one would be refused too."""

_SHORTER = (
    "The run goes on with --resume once the model has a longer context. A run of its own needs less of it with a "
    "scaffold of shorter prompts (--scaffold digest) or fewer searched parameters (--search)."
)
"""What to do about prompts that are longer than the model's context: --resume alone sends the same again."""


class Recorder:
    """The books of a run's language model: the journal's exchanges, and what they cost.

    The journal keeps every prompt, reply, vote and review. Of the events of an interrupted run, oldest first, what was
    answered is given again before the model is asked; what was lost is asked again. Once the ``allowance`` of the whole
    run is spent, the next call raises `BudgetSpent`. ``say`` is told of lost calls that are made again and of attempts
    within a call; ``asked`` of each call, with what was used before. ``usage`` is what the replies cost, ``calls`` how
    often the model was called, ``lost`` how many of these gave no reply.
    """

    def __init__(
        self,
        journal: Journal,
        earlier: Iterable[Mapping[str, Any]] = (),
        allowance: Allowance = UNLIMITED,
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.journal = journal
        self._allowance = allowance
        self.say = say
        self.asked: Callable[[Usage], None] = lambda usage: None
        self.usage = Usage()
        self.calls = self.lost = 0
        self._recorded: deque[Mapping[str, Any]] = deque()
        for event in earlier:
            if is_outcome(event):
                self._recorded.append(event)
            elif event["event"] == LOST_CALL:
                self.calls, self.lost = self.calls + 1, self.lost + 1

    @property
    def replies(self) -> int:
        """How many calls gave a reply."""
        return self.calls - self.lost

    def around(self, backend: Backend) -> Backend:
        """The backend with everything that passes recorded."""
        return backend.recorded_by(self) if isinstance(backend, Layer) else RecordingBackend(backend, self)

    def recorded(self, *kinds: str) -> Mapping[str, Any] | None:
        """The next event of the interrupted run; None once all were given.

        Raises `BsaError` if it is none of these kinds.
        """
        if not self._recorded:
            return None
        if self._recorded[0]["event"] not in kinds:
            raise BsaError(
                f'the journal does not fit: {self.journal.path} has a "{self._recorded[0]["event"]}" '
                f'where this version has a "{kinds[0]}".',
                "resume with the version and the settings that began the run, or start a new one.",
            )
        return self._recorded.popleft()

    def record(self, kind: str, **fields: Any) -> None:
        """Write an event that follows from those before it, unless the interrupted run wrote it."""
        if self.recorded(kind) is None:
            self.journal.append(kind, **fields)

    def count_reply(self, usage: Usage) -> None:
        """Enter a call that gave a reply."""
        self.calls += 1
        self.usage = self.usage + usage

    def note_unknown_price(self) -> None:
        """Write down, and tell, that the cost of the run is not known."""
        holds = " --max-cost cannot end the run." if self._allowance.max_cost_usd is not None else ""
        text = f"The price of this language model is not known, so neither is the cost of the run.{holds}"
        self.journal.append("note", text=text)
        self.say(text)

    def count_lost(self) -> None:
        """Enter a call that gave none."""
        self.calls += 1
        self.lost += 1

    def check_allowance(self) -> None:
        """Whether another call may be made. Raises `BudgetSpent` if not."""
        if spent := self._allowance.spent(self.usage.tokens, self.usage.cost_usd or 0.0):
            raise BudgetSpent(spent)


@runtime_checkable
class Layer(Protocol):
    """A backend around another one that has something of its own to record."""

    def recorded_by(self, recorder: Recorder) -> Backend:
        """The same, with the backend inside recorded (`Recorder.around`)."""


def is_outcome(event: Mapping[str, Any]) -> bool:
    """Whether an event was handed on to the proposer; a lost call was not, unless the prompt was refused."""
    return event["event"] in (REPLY, VOTE, REVIEW) or (event["event"] == LOST_CALL and bool(event.get("refused")))


class BackendAround:
    """A backend that asks another one; what it does not change is that of the other."""

    def __init__(self, inner: Backend) -> None:
        self._inner = inner
        self.name = inner.name
        self.sees_images = inner.sees_images

    def close(self) -> None:
        """Release the model."""
        self._inner.close()


class RecordingBackend(BackendAround):
    """Stands before the language model.

    A lost call is made again, so that an outage never changes what the search does: it goes on as if nothing had
    been, or it stops until the model can be had.
    """

    def __init__(self, inner: Backend, recorder: Recorder) -> None:
        super().__init__(inner)
        self._recorder = recorder
        if isinstance(inner, TellsMeanwhile):
            inner.tell_meanwhile(lambda text: recorder.say(text))
        self._answered = False
        self._refused = 0

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `Backend.complete`.

        Raises `PromptRefused` if the server does not take this prompt, `Outage` if the call was lost as often as it may
        be or nothing was ever there to answer, and `BudgetSpent` if the allowance is used up.
        """
        event = self._recorder.recorded(REPLY, LOST_CALL)
        if event is not None:
            return self._again(event)
        prompt = [{"role": message.role, "text": message.text, "images": len(message.images)} for message in messages]
        waits = iter(ASK_AGAIN_AFTER_S)
        while True:
            self._recorder.check_allowance()
            self._recorder.asked(self._recorder.usage)
            started = time.perf_counter()
            try:
                reply = self._inner.complete(messages, schema, seed=seed)
            except BackendFailure as failure:
                self._lost(failure, prompt, next(waits, None))
                continue
            reply = replace(
                reply,
                text=redact(reply.text),
                usage=replace(reply.usage, seconds=reply.usage.seconds or time.perf_counter() - started),
                model=redact(reply.model),
                notes=tuple(map(redact, reply.notes)),
            )
            price_was_known = self._recorder.usage.cost_usd is not None
            self._heard(reply.usage)
            self._answered = True
            fields = {key: value for key, value in asdict(reply).items() if key != "notes"}
            self._recorder.journal.append(REPLY, **fields, notes=list(reply.notes), prompt=prompt)
            if price_was_known and reply.usage.cost_usd is None:
                self._recorder.note_unknown_price()
            return reply

    def _lost(self, failure: BackendFailure, prompt: list[dict[str, Any]], wait_s: float | None) -> None:
        """Write a lost call down and wait for the time to make it again, or raise what ends the trying."""
        reason = redact(str(failure))
        self._refused += isinstance(failure, PromptRefused)
        handed_on = isinstance(failure, PromptRefused) and self._refused < MOST_REFUSED
        self._recorder.count_lost()
        self._recorder.journal.append(LOST_CALL, reason=reason, prompt=prompt, refused=handed_on)
        if handed_on:
            raise PromptRefused(reason) from None
        nobody = isinstance(failure, BackendUnreachable) and not self._answered
        if wait_s is None or nobody or isinstance(failure, PromptRefused):
            advice = _SHORTER if isinstance(failure, PromptTooLong) else ""
            raise Outage(f"the language model gave no reply: {reason}", advice) from None
        self._recorder.say(f"no reply ({reason}); asked again in {wait_s:g} s")
        time.sleep(wait_s)

    def _again(self, event: Mapping[str, Any]) -> Reply:
        if isinstance(self._inner, GivesInOrder):
            self._inner.pass_over()
        if event["event"] == LOST_CALL:
            self._recorder.count_lost()
            self._refused += 1
            raise PromptRefused(event["reason"])
        usage = Usage(**event["usage"])
        self._heard(usage)
        return Reply(event["text"], usage, event["model"], event["structured_by"], tuple(event["notes"]))

    def _heard(self, usage: Usage) -> None:
        self._refused = 0
        self._recorder.count_reply(usage)
