"""What a run may spend on its language model; its journal keeps it, so that it holds when the run is taken up again."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from .journal import Journal

ALLOWANCE = "allowance"
"""Event of the journal: what may be spent from there on."""


@dataclass(frozen=True)
class Allowance:
    """What may be spent on language models; None for as much as it takes."""

    max_tokens: int | None = None
    max_cost_usd: float | None = None

    def spent(self, tokens: int, cost_usd: float) -> str:
        """Which limit so much has reached, ``"$1.0200 spent of --max-cost 1"``; empty where none."""
        if self.max_tokens is not None and tokens >= self.max_tokens:
            return f"{tokens} tokens used of --max-tokens {self.max_tokens}"
        if self.max_cost_usd is not None and cost_usd >= self.max_cost_usd:
            return f"${cost_usd:.4f} spent of --max-cost {self.max_cost_usd:g}"
        return ""

    def larger(self, tokens: int, cost_usd: float) -> dict[str, float]:
        """Twice each limit that so much has reached, by its option; empty where none."""
        found: dict[str, float] = {}
        if self.max_tokens is not None and tokens >= self.max_tokens:
            found["max_tokens"] = 2 * max(tokens, self.max_tokens) or 1
        if self.max_cost_usd is not None and cost_usd >= self.max_cost_usd:
            found["max_cost"] = float(f"{2.0 * max(cost_usd, self.max_cost_usd) or 1.0:.3g}")
        return found


UNLIMITED = Allowance()
"""As much as it takes."""


def allowance_of(events: Iterable[Mapping[str, Any]]) -> Allowance:
    """What a run may spend by its journal: what it was given last."""
    found = UNLIMITED
    for event in events:
        if event["event"] == ALLOWANCE:
            found = Allowance(event["max_tokens"], event["max_cost_usd"])
    return found


def kept_allowance(journal: Journal, earlier: Iterable[Mapping[str, Any]], given: Allowance) -> Allowance:
    """What is given, and of the rest what the ``earlier`` events of the run hold; written down where it is another."""
    before = allowance_of(earlier)
    now = Allowance(
        before.max_tokens if given.max_tokens is None else given.max_tokens,
        before.max_cost_usd if given.max_cost_usd is None else given.max_cost_usd,
    )
    if now != before:
        journal.append(ALLOWANCE, **asdict(now))
    return now
