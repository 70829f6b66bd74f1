"""Asks for the unit of a time that nobody gave one, where seconds would make an impossible rate of it."""

import numpy as np

from ..errors import BsaError
from .samples import Samples
from .stretches import steady_stretches

_WHOLE_V = 1.0
"""A charge or a discharge that moves the voltage by more than this, in V, crosses most of a cell's window."""

_QUICKEST_S = 360.0
"""Time of a whole discharge at 10C, in s: faster ones are rare, so that minutes are the likelier unit."""


def check_time_unit(samples: Samples) -> None:
    """Ask for the unit of the time where the file has none and whole charges or discharges would take but seconds.

    Of samples whose times rise. Raises `BsaError` with the option that names the unit.
    """
    if "time" not in samples.without_unit or not np.any(samples.current):
        return
    first, last = steady_stretches(samples)
    voltage, seconds = samples.voltage, samples.time[last] - samples.time[first]
    whole = np.flatnonzero((np.abs(voltage[last] - voltage[first]) > _WHOLE_V) & (seconds > 0.0))
    if len(whole) == 0 or seconds[whole].max() > _QUICKEST_S:
        return
    k = int(whole[np.argmax(seconds[whole])])
    raise BsaError(
        f"{samples.source}: column {samples.column('time')} has no unit; in s the voltage would go from "
        f"{voltage[first[k]]:.4g} V ({samples.place(int(first[k]))}) to {voltage[last[k]]:.4g} V "
        f"({samples.place(int(last[k]))}) in {seconds[k]:.3g} s, a rate of about {3600.0 / seconds[k]:.2g}C.",
        "is it in min? Then say --unit time=min (or h, or s if that is right).",
    )
