"""What all models behind a server share: the order in which a call is tried, shortened, repeated and given up."""

import itertools
import random
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ..core.contracts.reply_parsing import MAX_REPLY_CHARS
from ..core.messages import (
    BackendFailure,
    JsonSchema,
    Message,
    PromptRefused,
    PromptTooLong,
    Reply,
    StructuredBy,
    Usage,
)
from ..core.redaction import redact
from .deadline import within
from .images import showable
from .options import BackendOptions
from .prompt_fitting import ContextTooSmallError, drop_memory
from .retrying import Persistence, TransientError
from .structured_output import FormRefusedError, descend, held_by, shortened, with_schema_in_prompt

# Client libraries end a call on their own a little later; the deadline is for those that do not.
_GRACE_S = 2.0
_SEED_STRIDE = 7919
# A reply has three strings of free text besides its changes; at worst each character of them is a token.
_TOKENS_PER_CHAR = 4
# Some servers answer a schema they cannot digest with an internal error, always the same.
_FAULTS_OF_A_FORM = 3


@dataclass(frozen=True)
class Answer:
    """What a server said."""

    text: str  # The model's words.
    model: str  # The model, in the server's words.
    usage: Usage  # Tokens and cost; the time is measured by the caller.
    cut: bool = False  # Whether the reply was ended by its length.


@dataclass(frozen=True)
class Request:
    """What a server is asked once."""

    messages: Sequence[Message]  # The conversation.
    schema: JsonSchema  # JSON Schema of the wanted object.
    form: StructuredBy  # How the server shall hold the model to it.
    seed: int  # Seed for sampling, below 2**31: some servers keep it in 32 bits with a sign.
    timeout_s: float  # Longest wait.


class ServedBackend(ABC):
    """A model behind a server; refusals are remembered by ``server``: route, address and model."""

    sees_images: bool
    strictest: StructuredBy = "schema"

    def __init__(self, name: str, server: str, options: BackendOptions) -> None:
        self.name = name
        self.options = options
        self._server = server
        self._say: Callable[[str], None] = lambda text: None

    def tell_meanwhile(self, say: Callable[[str], None]) -> None:
        """See `bsa.core.messages.TellsMeanwhile.tell_meanwhile`."""
        self._say = say

    @abstractmethod
    def ask(self, request: Request, notes: list[str]) -> Answer:
        """Ask once.

        Raises `TransientError` if another attempt may work, `TimeoutError` if the answer did not end in time,
        `FormRefusedError` if the server does not take this form of request, `ContextTooSmallError` if the prompt is too
        long, and `BsaError` if no attempt can work.
        """

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `bsa.core.messages.Backend.complete`."""
        notes: list[str] = []
        refused: list[Usage] = []
        started = time.monotonic()
        if self.options.max_reply_tokens is not None:
            schema = shortened(schema, self.options.max_reply_tokens // _TOKENS_PER_CHAR)
        shown = showable(messages, self.sees_images, notes)
        timeout_s = self.options.server_timeout_s
        persistence = Persistence(timeout_s, self.options.retry_limit_s, notes, random.Random(seed), self._tell)

        def in_form(form: StructuredBy) -> Answer:
            prompt = with_schema_in_prompt(shown, schema, form)
            seeds = itertools.count(seed, _SEED_STRIDE)
            faults = itertools.count(1)

            def attempt(allowed_s: float) -> Answer:
                # A server that fails over what its model said would say and fail the same again.
                request = Request(prompt, schema, form, next(seeds) % 2**31, allowed_s)
                try:
                    return within(allowed_s + _GRACE_S, lambda: self.ask(request, notes))
                except TimeoutError:
                    cut = ", all that retry_limit_s left" * (allowed_s < timeout_s)
                    raise TransientError(f"no answer within {allowed_s:.3g} s{cut}") from None
                except TransientError as failure:
                    if failure.server_fault and form != "text" and next(faults) == _FAULTS_OF_A_FORM:
                        raise FormRefusedError(failure.reason, certain=False) from None
                    raise

            try:
                return persistence.call(attempt)
            except FormRefusedError as refusal:
                refused.append(refusal.usage)
                raise

        while True:
            try:
                answer, form = descend(self._server, in_form, notes, self.strictest)
                break
            except ContextTooSmallError:
                try:
                    shown = drop_memory(shown, notes)
                except ContextTooSmallError:
                    raise PromptTooLong(
                        f"{self.name}: the prompt, with room for the reply (max_reply_tokens), is longer than the "
                        "model's context"
                    ) from None
            except FormRefusedError as refusal:
                raise PromptRefused(redact(f"{self.name} refuses the request: {refusal}")) from None
            except BackendFailure as failure:
                raise type(failure)(redact(f"{self.name}: {failure}")) from None
        usage = replace(sum(refused, answer.usage), seconds=time.monotonic() - started)
        return self._reply(replace(answer, usage=usage), form, schema, notes)

    def _tell(self, text: str) -> None:
        self._say(redact(f"{self.name}: {text}"))

    def _reply(self, answer: Answer, form: StructuredBy, schema: JsonSchema, notes: list[str]) -> Reply:
        # Before it is cut: half a key is not recognised.
        text = redact(answer.text)
        if answer.cut:
            notes.append("the reply was cut at its longest length (--max-reply-tokens)")
        if len(text) > MAX_REPLY_CHARS:
            notes.append(f"the reply has {len(text)} characters; only the first {MAX_REPLY_CHARS} are kept")
            text = text[:MAX_REPLY_CHARS]
        held = held_by(form, text, schema)
        if held != form:
            notes.append(f"the server took the request for {form} but did not keep to it")
        return Reply(
            text=text,
            usage=answer.usage,
            model=redact(answer.model)[:200],
            structured_by=held,
            notes=tuple(redact(note) for note in notes),
        )

    def close(self) -> None:  # noqa: B027  (nothing to release unless a route holds a connection)
        """Release the connection."""
