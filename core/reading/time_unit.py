"""Asks for the unit of a time that nobody gave one, where seconds would make an unheard-of rate of it."""

import numpy as np

from ..errors import BsaError
from ..printable import rounded
from ..trajectory import SECONDS_PER_HOUR
from .samples import Samples
from .stretches import steady_stretches

_WHOLE_V = 1.0
"""A charge or a discharge that moves the voltage by more than this, in V, crosses most of a cell's window."""

_QUICKEST_S = 360.0
"""Time of a whole discharge at 10C, in s: faster ones are rare, so that minutes are the likelier unit."""

_QUICK_S = 1800.0
"""Time of a whole discharge at 2C, in s: few cells are tested faster alone, and a slow test in minutes is as likely."""

_SLOWEST_S = 200.0 * SECONDS_PER_HOUR
"""Time of a whole discharge at C/200, in s: curves near the open circuit are measured at C/10 to C/100, so that
milliseconds are the likelier unit."""


def with_doubtful_unit_noted(samples: Samples) -> Samples:
    """Ask for the unit of the time where the file has none and whole charges or discharges would take seconds or weeks.

    Where all would be quick, above 2C, a note asks. Of samples whose times rise. Raises `BsaError` with the option that
    names the unit.
    """
    if "time" not in samples.without_unit or not np.any(samples.current):
        return samples
    first, last = steady_stretches(samples)
    voltage, seconds = samples.voltage, samples.time[last] - samples.time[first]
    whole = np.flatnonzero((np.abs(voltage[last] - voltage[first]) > _WHOLE_V) & (seconds > 0.0))
    if len(whole) == 0:
        return samples
    longest, shortest = whole[np.argmax(seconds[whole])], whole[np.argmin(seconds[whole])]
    if seconds[longest] <= _QUICKEST_S:
        raise _asking(samples, int(first[longest]), int(last[longest]), "min", "h, or ")
    if seconds[shortest] >= _SLOWEST_S:
        raise _asking(samples, int(first[shortest]), int(last[shortest]), "ms")
    if seconds[longest] < _QUICK_S:
        took = seconds[longest]
        return samples.noted(
            f"{_would_go(samples, int(first[longest]), int(last[longest]))}. Is it in min, a rate of about "
            f"{_rate(60.0 * took)}? Then say --unit time=min (or s if that is right)."
        )
    return samples


def _asking(samples: Samples, first: int, last: int, likely: str, also: str = "") -> BsaError:
    return BsaError(
        f"{samples.source}: {_would_go(samples, first, last)}.",
        f"is it in {likely}? Then say --unit time={likely} (or {also}s if that is right).",
    )


def _would_go(samples: Samples, first: int, last: int) -> str:
    """How quick a charge or a discharge is if the time is in s."""
    seconds, voltage = float(samples.time[last] - samples.time[first]), samples.voltage
    return (
        f"column {samples.column('time')} has no unit; in s the voltage would go from "
        f"{voltage[first]:.4g} V ({samples.place(first)}) to {voltage[last]:.4g} V ({samples.place(last)}) in "
        f"{_duration(seconds)}, a rate of about {_rate(seconds)}"
    )


def _rate(seconds: float) -> str:
    """The C-rate of a whole charge or discharge that takes so long."""
    rate = SECONDS_PER_HOUR / seconds
    return f"{rate:.2g}C" if rate >= 1.0 else f"C/{1.0 / rate:.0f}"


def _duration(seconds: float) -> str:
    return f"{rounded(seconds, 3)} s" if seconds < _SLOWEST_S else f"{seconds / 86400.0:.3g} days"
