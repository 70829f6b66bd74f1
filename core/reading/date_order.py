"""Which comes first in dates such as 03/04/2024, the month or the day: decided once for all files of a cell."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from ..errors import BsaError
from ..printable import listed
from ..trajectory import FloatArray
from .samples import Extra, Samples

_LISTED = 5
_NAME_DATES = (
    re.compile(r"(?<!\d)(?P<y>(?:19|20)\d\d)[-_.]?(?P<a>\d\d)[-_.]?(?P<b>\d\d)(?!\d)"),
    re.compile(
        r"(?<!\d)(?=(?P<a>\d{1,2})(?P<s>[-_.])(?P<b>\d{1,2})(?P=s)(?P<y>\d{4}|\d\d)(?!\d)"
        r"(?:[-_ ](?P<hour>\d\d)[.:h](?P<minute>\d\d))?)"
    ),
)
_DATES: tuple[Extra, ...] = ("date", "day")


def with_one_order(parts: Sequence[Samples]) -> list[Samples]:
    """The parts, their dates read with the order of month and day that one of them tells.

    Where none tells it, the month is taken to come first, with a note if the other order would be of other moments.
    Raises `BsaError` if the parts would then follow each other in another way.
    """
    told = {part.day_first for part in parts if part.day_first is not None}
    other = [_exchanged(part) for part in parts]
    if len(told) == 1:
        return [_settled(part) for part in (other if told == {True} else parts)]
    if all(two is one for one, two in zip(parts, other, strict=True)):
        return list(parts)
    ends, ends_other = _ends(parts), _ends(other)
    if not _follow_alike(ends, ends_other):
        raise _untold(parts, "write dates as 2024-03-01 10:00:00.")
    if np.allclose(np.diff(ends), np.diff(ends_other), equal_nan=True):
        return list(parts)
    note = "the dates do not tell the month from the day; the month was taken to come first."
    return [parts[0].noted(note), *parts[1:]]


def starts_of(parts: Sequence[Samples]) -> FloatArray:
    """When each part began, s since 1970, by its samples or else by its name; NaN where neither tells.

    Raises `BsaError` if the dates in the names do not tell the month from the day, and the order of the parts hangs on
    it.
    """
    month_first, day_first = (np.array([_start(part, order) for part in parts]) for order in (False, True))
    if np.isnan(month_first).any():
        return day_first
    if not (np.isnan(day_first).any() or _follow_alike(month_first, day_first)):
        raise _untold(parts, "write the dates in their names as 2024-03-01.")
    return month_first


def date_at(part: Samples, end: int) -> float:
    """The first date of the samples (0), or the last one (-1), s since 1970; NaN without dates."""
    dates = next((part.extra[name] for name in _DATES if name in part.extra), np.zeros(0))
    known = dates[np.isfinite(dates)]
    return float(known[end]) if len(known) else np.nan


def _start(part: Samples, day_first: bool) -> float:
    own = date_at(part, 0)
    return _in_name(part.source, day_first) if np.isnan(own) else own


def _follow_alike(one: FloatArray, other: FloatArray) -> bool:
    return np.array_equal(np.argsort(one, kind="stable"), np.argsort(other, kind="stable"))


def _exchanged(part: Samples) -> Samples:
    """The part with month and day exchanged; the part itself where it does not leave that open."""
    if "other_date" not in part.extra:
        return part
    dates = {name: part.extra["other_date"] for name in _DATES if name in part.extra}
    return replace(part, extra={**part.extra, **dates})


def _settled(part: Samples) -> Samples:
    return replace(part, extra={name: values for name, values in part.extra.items() if name != "other_date"})


def _ends(parts: Sequence[Samples]) -> FloatArray:
    """When each part begins and ends by its own dates."""
    return np.array([date_at(part, end) for part in parts for end in (0, -1)])


def _untold(parts: Sequence[Samples], hint: str) -> BsaError:
    return BsaError(
        "the dates of files that are to be joined do not tell the month from the day, and the order of the files "
        f"depends on it: {listed((part.source for part in parts), _LISTED)}.",
        hint,
    )


def _in_name(name: str, day_first: bool) -> float:
    """The date in a file's name, ``2010-08-17``, ``8_17_10`` or ``03-11-17_08.47``; NaN where it is none."""
    for written in _written_in(name):
        orders = [_moment(written, day_first) for day_first in (False, True)]
        if not np.isnan(orders).all():
            year_first = written["s"] is None
            return next(value for value in orders if value == value) if year_first else orders[day_first]
    return np.nan


def _written_in(name: str) -> Iterator[dict[str, str | None]]:
    """What looks like a date in a file's name, the last one first."""
    for pattern in _NAME_DATES:
        for found in reversed(list(pattern.finditer(name))):
            yield {"s": None, "hour": None, "minute": None, **found.groupdict()}


def _moment(written: dict[str, str | None], day_first: bool) -> float:
    """Seconds since 1970; NaN where there is no such day."""
    year, a, b, hour, minute = (int(written[key] or 0) for key in ("y", "a", "b", "hour", "minute"))
    month, day = (b, a) if day_first else (a, b)
    try:
        return datetime(year if year > 99 else 2000 + year, month, day, hour, minute, tzinfo=UTC).timestamp()
    except ValueError:
        return np.nan
