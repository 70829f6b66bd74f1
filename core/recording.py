"""A backend that writes every exchange into the journal, and on resume answers from it first."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from .journal import Journal
from .messages import Backend, BackendFailure, BudgetSpent, JsonSchema, Message, Reply, Usage

REPLY, LOST_CALL = "reply", "lost-call"


class RecordingBackend:
    """Stands between the proposer and the language model.

    Parameters
    ----------
    inner : Backend
        The model.
    journal : Journal
        Where every prompt and reply is kept.
    recorded : iterable of mapping
        The exchanges of an interrupted run, oldest first; they are given again before the model is asked.
    max_tokens, max_cost_usd : optional
        Allowance of the whole run; once spent, the next call raises `BudgetSpent`.
    """

    def __init__(
        self,
        inner: Backend,
        journal: Journal,
        recorded: Iterable[Mapping[str, Any]] = (),
        max_tokens: int | None = None,
        max_cost_usd: float | None = None,
    ) -> None:
        self._inner = inner
        self._journal = journal
        self._recorded = deque(recorded)
        self._max_tokens = max_tokens
        self._max_cost_usd = max_cost_usd
        self.usage = Usage()
        self.calls = 0

    @property
    def name(self) -> str:
        """Name of the model behind."""
        return self._inner.name

    @property
    def sees_images(self) -> bool:
        """Whether the model behind can see."""
        return self._inner.sees_images

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `Backend.complete`."""
        if self._recorded:
            return self._again(self._recorded.popleft())
        self._check_allowance()
        prompt = [{"role": message.role, "text": message.text, "images": len(message.images)} for message in messages]
        try:
            reply = self._inner.complete(messages, schema, seed=seed)
        except BackendFailure as failure:
            self.calls += 1
            self._journal.append(LOST_CALL, reason=str(failure), prompt=prompt)
            raise
        self._count(reply.usage)
        self._journal.append(
            REPLY,
            text=reply.text,
            usage=asdict(reply.usage),
            model=reply.model,
            structured_by=reply.structured_by,
            notes=list(reply.notes),
            prompt=prompt,
        )
        return reply

    def _again(self, event: Mapping[str, Any]) -> Reply:
        if event["event"] == LOST_CALL:
            self.calls += 1
            raise BackendFailure(event["reason"])
        usage = Usage(**event["usage"])
        self._count(usage)
        return Reply(event["text"], usage, event["model"], event["structured_by"], tuple(event["notes"]))

    def _count(self, usage: Usage) -> None:
        self.calls += 1
        self.usage = self.usage + usage

    def _check_allowance(self) -> None:
        if self._max_tokens is not None and self.usage.tokens >= self._max_tokens:
            raise BudgetSpent(f"{self.usage.tokens} tokens used of --max-tokens {self._max_tokens}")
        if self._max_cost_usd is not None and self.usage.cost_usd >= self._max_cost_usd:
            raise BudgetSpent(f"${self.usage.cost_usd:.4f} spent of --max-cost {self._max_cost_usd:g}")

    def close(self) -> None:
        """Release the model."""
        self._inner.close()
