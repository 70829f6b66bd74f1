"""Numbers in what others wrote: replies, feedback and sections of a prompt."""

from collections.abc import Mapping

_LARGEST = 1e30
"""Larger than any quantity in SI units, and small enough for the products of a least-squares fit to stay finite."""


def finite_number(value: object) -> float | None:
    """The value as a float; None where it is no number, or larger than any quantity is."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if abs(value) <= _LARGEST else None


def finite_numbers(content: object) -> dict[str, float]:
    """The entries of a mapping that are finite numbers; empty for what is no mapping."""
    if not isinstance(content, Mapping):
        return {}
    return {str(name): number for name, value in content.items() if (number := finite_number(value)) is not None}
