"""Dates and clocks as cyclers write them, in seconds."""

import re
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.errors import BsaError
from ...core.printable import shown
from ...core.trajectory import FloatArray
from .table import first_filled, is_missing, numbers_in

YEARS_S = (631152000.0, 4102444800.0)
"""1990 and 2100, in seconds since 1970: a number outside is no date of a measurement."""

_DAY = re.compile(r"(?P<a>\d+)(?P<mark>[-/.])(?P<b>\d+)[-/.]\d+")
_NAMED_DAY = re.compile(r"\d{1,2}[- ][A-Za-z]{3,9}[- ]\d{2,4}\b")
"""A date with the name of its month, as MATLAB writes it: ``13-Mar-2024 10:00:00``."""

_MOST_DAYS, _MOST_MONTHS = 31, 12

_ISO = re.compile(r"\d{4}-\d\d-\d\d")
_CLOCK = re.compile(r"(?:(?P<days>\d+)(?:\s*d(?:ays?,?)?\s*|-))?(?P<h>\d+):(?P<m>\d\d):(?P<s>\d\d?(?:[.,]\d*)?)")


def clock_s(text: str) -> float | None:
    """A time such as ``26:10:00.5``, ``1d 02:10:0,5`` or ``1-02:10:00`` in seconds; None where it is none."""
    found = _CLOCK.fullmatch(text.strip())
    if found is None:
        return None
    days, hours, minutes = (int(found[key] or 0) for key in ("days", "h", "m"))
    return days * 86400.0 + hours * 3600.0 + minutes * 60.0 + float(found["s"].replace(",", "."))


def is_clock_or_date(text: str) -> bool:
    """Whether a cell is a time in hours, minutes and seconds, or begins like a date; numbers are neither."""
    return clock_s(text) is not None or any(way.match(text.strip()) for way in (_DAY, _NAMED_DAY))


def is_date(numbers: FloatArray) -> bool:
    """Whether numbers can be seconds since 1970 at which something was measured."""
    known = numbers[np.isfinite(numbers)]
    return bool(len(known) and YEARS_S[0] < known.min() and known.max() < YEARS_S[1])


def elapsed_s(
    texts: Sequence[str], source: str, column: str, date: FloatArray | None = None
) -> tuple[FloatArray, FloatArray | None]:
    """The time that clocks or dates tell in s, and the dates in s since 1970, if these are any.

    Dates count from the first one. ``date`` is what another column of the file says: clocks that fall where its day
    changes are times of the day. NaN where a cell holds nothing. Raises `BsaError` where the month could be the day,
    and another time would pass then.
    """
    first = first_filled(texts)
    if clock_s(first) is not None:
        clock = np.array([np.nan if (value := clock_s(text)) is None else value for text in texts])
        if date is None or not _is_time_of_day(clock, date):
            return clock, None if date is None or is_of_days(date) else date  # a day alone orders no samples
        date = date + clock
        return since_first(date), date
    dates = seconds_of(texts)
    if dates is None:
        raise BsaError(
            f'{source}: column "{shown(column)}" holds no times that are understood (the first is "{shown(first)}").',
            "write them in seconds, as 26:10:00.5, or as 2024-03-01 10:00:00.",
        )
    since, (_, other) = since_first(dates), exchanged(texts)
    if other is not None and not np.allclose(since_first(other), since, equal_nan=True):
        raise BsaError(
            f'{source}: column "{shown(column)}" does not tell the month from the day ("{shown(first)}"), and '
            "another time would pass.",
            "write dates as 2024-03-01 10:00:00, or give a column of the time that has passed.",
        )
    return since, dates


def since_first(dates: FloatArray) -> FloatArray:
    """The time since the first date that is known."""
    return np.asarray(dates - dates[np.isfinite(dates)][0])


def is_of_days(date: FloatArray) -> bool:
    """Whether dates have no time, so that they order no samples."""
    return bool(np.all(np.mod(date[np.isfinite(date)], 86400.0) == 0.0))


def _is_time_of_day(clock: FloatArray, date: FloatArray) -> bool:
    """Whether clocks beside dates without a time, which most rows have, fall where the day changes and nowhere else."""
    if 2 * np.count_nonzero(np.isfinite(date)) < len(date):
        return False
    with np.errstate(invalid="ignore"):
        return is_of_days(date) and bool(np.all((np.diff(clock) < 0.0) == (np.diff(date) > 0.0)))


def _day_first(first: str) -> bool:
    """Whether the day comes first: it does between points (``1.3.2024``), which are written where that is usual."""
    found = _DAY.search(first)
    return found is not None and found["mark"] == "."


def _says_its_order(first: str) -> bool:
    """Whether a date tells the day from the month by how it is written: between points, or behind the year."""
    found = _DAY.match(first.strip())
    return found is not None and (found["mark"] == "." or int(found["a"]) > _MOST_DAYS)


def seconds_of(texts: Sequence[str]) -> FloatArray | None:
    """Dates as seconds since 1970, NaN where a cell holds none; None where the column holds no dates.

    The cells of one column are written alike: numbers (seconds since 1970), ISO 8601, a date with the name of its month
    (``11-Mar-2017``), or one of which the month comes before the day (``3/11/2017 8:47:03 AM``) unless a number above
    12 tells otherwise or they are parted by points (``11.3.2017``).
    """
    first = first_filled(texts)
    try:
        float(first)
    except ValueError:
        day_first = _day_told_first(texts) or _day_first(first)
        read = _read(texts, day_first, first)
        return _read(texts, not day_first, first) if read is None else read
    numbers = numbers_in(texts, decimal_comma=False)
    return numbers if is_date(numbers) else None


def exchanged(texts: Sequence[str]) -> tuple[bool | None, FloatArray | None]:
    """Whether the day comes before the month in dates, and the dates with both exchanged, as `seconds_of` gives them.

    The first is None where no date tells it; the second is None where one does, or the way of writing.
    """
    told, first = _day_told_first(texts), next(filter(_DAY.match, map(str.strip, texts)), "")
    open_to_both = told is None and bool(first) and not _says_its_order(first)
    return told, _read(texts, day_first=True, first=first) if open_to_both else None


def _day_told_first(texts: Sequence[str]) -> bool | None:
    """Whether numbers above 12 tell that the day comes first; None where none does, or the way of writing tells it."""
    days = [day for text in texts if (day := _DAY.match(text.strip()))]
    if not days or _says_its_order(days[0].string):
        return None
    most_a, most_b = (max(int(day[key]) for day in days) for key in ("a", "b"))
    return most_a > _MOST_MONTHS if max(most_a, most_b) > _MOST_MONTHS else None


def _read(texts: Sequence[str], day_first: bool, first: str) -> FloatArray | None:
    """Dates as seconds since 1970; None if they cannot be read so."""
    if not (_DAY.search(first) or _NAMED_DAY.match(first.strip())):
        return None
    import pandas

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pandas warns where it cannot infer one format; such a cell becomes NaN
        how: dict[str, Any] = {"format": "ISO8601"} if _ISO.match(first) else {"dayfirst": day_first}
        dates = pandas.to_datetime(list(texts), errors="coerce", utc=True, **how)
    values = np.where(dates.isna(), np.nan, (dates - pandas.Timestamp(0, tz="UTC")) / pandas.Timedelta(seconds=1))
    written = np.array([not is_missing(text) for text in texts])
    if np.count_nonzero(np.isfinite(values)) > 0.99 * np.count_nonzero(written):
        return values if is_date(values) else None
    return None
