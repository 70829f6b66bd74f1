"""Numbers in what others wrote: replies, feedback and sections of a prompt; and numbers as JSON can hold them."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

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


def json_ready(value: Any, digits: int | None = None) -> Any:
    """The same content with what JSON cannot say as None, and NumPy's numbers as Python's.

    ``digits`` are those that floats are rounded to, significant ones; left out, they stay as they are.
    """
    if isinstance(value, dict):
        return {str(key): json_ready(entry, digits) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_ready(entry, digits) for entry in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if not isinstance(value, (float, np.floating)):
        return value
    if not math.isfinite(value):
        return None
    return float(value) if digits is None else float(f"{value:.{digits}g}")
