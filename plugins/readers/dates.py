"""Dates as cyclers write them, in seconds."""

import re
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.trajectory import FloatArray

YEARS_S = (631152000.0, 4102444800.0)
"""1990 and 2100, in seconds since 1970: a number outside is no date of a measurement."""

_DAY = re.compile(r"\d+[-/.]\d+[-/.]\d+")
_ISO = re.compile(r"\d{4}-\d\d-\d\d")


def seconds_of(texts: Sequence[str]) -> FloatArray | None:
    """Dates as seconds since 1970, NaN where a cell holds none; None where the column holds no dates.

    The cells of one column are written alike: numbers (seconds since 1970), ISO 8601, or a date of which the month
    comes before the day unless it cannot (``3/11/2017 8:47:03 AM``).
    """
    first = next((text for text in texts if text), "")
    try:
        float(first)
    except ValueError:
        return _parsed(texts, day_first=False, first=first)
    numbers = np.array([_number(text) for text in texts])
    known = numbers[np.isfinite(numbers)]
    return numbers if len(known) and YEARS_S[0] < known.min() and known.max() < YEARS_S[1] else None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _parsed(texts: Sequence[str], day_first: bool, first: str) -> FloatArray | None:
    if not _DAY.search(first):
        return None
    import pandas

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pandas warns where it cannot infer one format; such a cell becomes NaN
        how: dict[str, Any] = {"format": "ISO8601"} if _ISO.match(first) else {"dayfirst": day_first}
        dates = pandas.to_datetime(list(texts), errors="coerce", utc=True, **how)
    values = np.where(dates.isna(), np.nan, (dates - pandas.Timestamp(0, tz="UTC")) / pandas.Timedelta(seconds=1))
    written = np.array([bool(text) for text in texts])
    if np.count_nonzero(np.isfinite(values)) > 0.99 * np.count_nonzero(written):
        inside = values[np.isfinite(values)]
        return values if YEARS_S[0] < inside.min() and inside.max() < YEARS_S[1] else None
    return None if day_first else _parsed(texts, True, first)
