"""What the prompt says of the numerical fit beside the agent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...core.numbers import finite_number
from ...core.prompt_sections import RECORD, named


@dataclass(frozen=True)
class Record:
    """Names of the parameters that the measured record does not fix, or tells only together; it fixes all others."""

    leaves_open: tuple[str, ...] = ()
    narrows: tuple[str, ...] = ()
    only_together: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Numerics:
    """Where the fit stands."""

    status: str = ""  # What the fit is doing.
    misfits: tuple[float, ...] = ()  # In tolerances, of the latest rounds.
    allowance: int = 1  # Simulations that the agent may direct, at least 1.
    actions: tuple[str, ...] = ()  # Kinds of the agent's latest actions.
    record: Record | None = None  # None while no slopes are known.

    @classmethod
    def read(cls, content: object, parameters: Sequence[str] = ()) -> Numerics:
        """From the content of a section; whatever is not of its form is left out.

        ``parameters`` are in the order of the prompt's table, by whose numbers the record may name them.
        """
        if not isinstance(content, Mapping):
            return cls()
        misfits = [finite_number(value) for value in entries(content.get("misfit_tolerances_by_round"))]
        actions = [entry for entry in entries(content.get("your_last_actions")) if isinstance(entry, Mapping)]
        return cls(
            status=str(content.get("status", "")),
            misfits=tuple(value for value in misfits if value is not None),
            allowance=max(int(finite_number(content.get("simulations_you_may_spend")) or 1), 1),
            actions=tuple(str(entry.get("action", "")) for entry in actions),
            record=_record(content.get(RECORD), parameters),
        )


def _record(content: object, parameters: Sequence[str]) -> Record | None:
    if not isinstance(content, Mapping):
        return None

    def names(listed: object) -> tuple[str, ...]:
        return tuple(named(entry, parameters) for entry in entries(listed) if isinstance(entry, (str, int)))

    groups = [names(group) for group in entries(content.get("only_together"))]
    return Record(
        names(content.get("leaves_open")), names(content.get("narrows")), tuple(group for group in groups if group)
    )


def entries(content: object) -> list[Any]:
    """The entries of a list; none for what is no list."""
    return content if isinstance(content, list) else []


def words(content: object) -> tuple[str, ...]:
    """The strings in a list."""
    return tuple(entry for entry in entries(content) if isinstance(entry, str))
