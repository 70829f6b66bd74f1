"""The one method behind which every language model stands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol, runtime_checkable

Role = Literal["system", "user", "assistant"]
StructuredBy = Literal["tools", "schema", "json", "text"]
JsonSchema = Mapping[str, Any]

ALTERNATIVES = "anyOf"
"""Key of an object's schema under which stand the schemas of which it must satisfy one. The object's own properties are
those of all of them together."""


def without_alternatives(schema: JsonSchema) -> dict[str, Any]:
    """The schema of an object by its own properties alone: shorter, and taken where alternatives are not."""
    return {key: value for key, value in schema.items() if key != ALTERNATIVES}


UNUSABLE = "That reply cannot be used:"
"""How a message begins that asks again, before what was wrong with the reply."""


@dataclass(frozen=True)
class Message:
    """One turn of a conversation.

    Attributes
    ----------
    role : {'system', 'user', 'assistant'}
        Who speaks.
    text : str
        What is said.
    images : tuple of Path
        PNG files shown with the text; a backend that cannot see leaves them out.
    """

    role: Role
    text: str
    images: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Usage:
    """What a call cost.

    Attributes
    ----------
    prompt_tokens, completion_tokens, reasoning_tokens : int
        Tokens as the provider counts them (reasoning tokens are part of the completion tokens).
    cost_usd : float or None
        Price in US dollars; 0 for local models, None where nobody knows it.
    seconds : float
        Wall time of the call, retries included. A run measures it itself where this is 0.
    """

    prompt_tokens: int = 0
    completion_tokens: int = 0
    reasoning_tokens: int = 0
    cost_usd: float | None = 0.0
    seconds: float = 0.0

    @property
    def tokens(self) -> int:
        """Prompt and completion tokens together."""
        return self.prompt_tokens + self.completion_tokens

    @property
    def price(self) -> str:
        """What was paid, in words: ``"$0.0123"``, or that it is not known."""
        return "price unknown" if self.cost_usd is None else f"${self.cost_usd:.4f}"

    @property
    def words(self) -> str:
        """What was used and paid: ``"1234 tokens, $0.0123"``; without a price where it is nothing."""
        if not self.tokens:
            return "no tokens"
        return f"{self.tokens} tokens" + f", {self.price}" * (self.cost_usd != 0)

    def __add__(self, other: Usage) -> Usage:
        return Usage(
            self.prompt_tokens + other.prompt_tokens,
            self.completion_tokens + other.completion_tokens,
            self.reasoning_tokens + other.reasoning_tokens,
            None if self.cost_usd is None or other.cost_usd is None else self.cost_usd + other.cost_usd,
            self.seconds + other.seconds,
        )


@dataclass(frozen=True)
class Reply:
    """What a model answered. The text is untrusted.

    Attributes
    ----------
    text : str
        The answer as it came.
    usage : Usage
        What it cost.
    model : str
        The model that answered, in the provider's words.
    structured_by : {'schema', 'json', 'text'}
        What held the answer to the schema: the server or decoder itself, the server's JSON mode, or
        nothing but the prompt.
    notes : tuple of str
        What the backend did on the way (retries, fallbacks, dropped images), for the journal.
    rejected : tuple of str
        Of a reply that was merged from several: what was wrong with each of the others that could not be used.
    """

    text: str
    usage: Usage = Usage()
    model: str = ""
    structured_by: StructuredBy = "text"
    notes: tuple[str, ...] = ()
    rejected: tuple[str, ...] = ()


class BackendFailure(Exception):
    """A call that gave no reply within its retries: a lost call, which says nothing about the model."""


class BackendUnreachable(BackendFailure):
    """Nothing listens where the model should be: connection refused, unknown host, no route.

    Trying again within seconds rarely helps, so a backend raises it after a few attempts at most.
    """


class PromptRefused(BackendFailure):
    """The server answered, and does not take this prompt: too long for the model's context, or of no form it knows.

    Asking the same again would give the same.
    """


class PromptTooLong(PromptRefused):
    """The prompt is longer than the model's context, also without all that may be left out of it."""


class ReplyRefused(BackendFailure):
    """A person read the reply and refused it.

    Parameters
    ----------
    reply : Reply
        What the model had answered.
    reason : str
        Why it was refused; the model may read it.
    """

    def __init__(self, reply: Reply, reason: str) -> None:
        super().__init__(f"the reviewer refused it: {reason}.")
        self.reply = reply
        self.reason = reason


class RunStopped(Exception):
    """The run cannot go on for now; raised from a call of the model, so that the run stops cleanly and resumably.

    Nothing between the model and the run loop may catch it.

    Parameters
    ----------
    reason : str
        Why, in a sentence without its full stop.
    advice : str
        How the run goes on, in sentences, where ``--resume`` alone would stop at the same place.
    """

    def __init__(self, reason: str, advice: str = "") -> None:
        super().__init__(reason)
        self.advice = advice


class BudgetSpent(RunStopped):
    """The run's allowance of tokens or money is used up, or nobody is there to answer any more."""


class Outage(RunStopped):
    """The model could not be had: calls were lost until there was no point in asking again."""


@runtime_checkable
class TellsMeanwhile(Protocol):
    """A backend that can say what goes on within a call, as that an attempt failed and another one is made."""

    def tell_meanwhile(self, say: Callable[[str], None]) -> None:
        """Have ``say`` called with each such line, from the thread of the call."""


@runtime_checkable
class GivesInOrder(Protocol):
    """A backend whose next answer follows from how many it has given, as of one that repeats a journal."""

    def pass_over(self) -> None:
        """Leave out the next answer: a resumed run has it from its own journal."""


@runtime_checkable
class Backend(Protocol):
    """A language model: messages and a JSON schema in, text and usage out."""

    @property
    def name(self) -> str:
        """What the model is called in results and reports."""

    @property
    def sees_images(self) -> bool:
        """Whether images are worth sending."""

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """Answer the conversation with one JSON object.

        Parameters
        ----------
        messages : sequence of Message
            The conversation so far, oldest first.
        schema : mapping
            JSON Schema of the wanted object.
        seed : int
            Seed for sampling, where the model takes one.

        Returns
        -------
        Reply

        Raises
        ------
        BackendUnreachable
            When there is no connection to the model.
        PromptRefused
            When this prompt cannot be answered, now or later.
        ReplyRefused
            When a person refused the reply.
        BackendFailure
            When retries within the stated limit gave no reply.
        BsaError
            When the backend cannot work at all (no key, no such model).
        """

    def close(self) -> None:
        """Release what the backend holds."""
