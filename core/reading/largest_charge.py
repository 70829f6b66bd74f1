"""Asks for a unit where a record passes more charge than any cell holds."""

import numpy as np

from ..errors import BsaError
from ..printable import rounded
from ..record import ReadOptions
from ..trajectory import SECONDS_PER_HOUR, drawn_between
from .samples import Samples
from .stretches import stretches

_LARGEST_AH = 2000.0
"""The largest lithium-ion cells for energy storage hold 1,000 to 1,300 A.h; mA taken for A make one of 2 A.h as
large as this."""


def check_charge(samples: Samples, options: ReadOptions) -> None:
    """Refuse a record in which more charge passes in one direction than a cell holds, unless a person says its unit.

    Of samples whose times rise. Raises `BsaError` with the options that name the units.
    """
    if "current" in options.units or options.constant_current_a is not None or not np.any(samples.current):
        return
    first, last = stretches(samples)
    passed = np.concatenate([[0.0], np.cumsum(drawn_between(samples.time, samples.current))]) / SECONDS_PER_HOUR
    charges = np.abs(passed[last] - passed[first])
    k = int(np.argmax(charges))
    if charges[k] <= _LARGEST_AH:
        return
    raise BsaError(
        f"{samples.source}: {rounded(charges[k], 4)} A.h pass in one direction from {samples.place(int(first[k]))} to "
        f"{samples.place(int(last[k]))}, more than any cell holds (column {samples.column('current')}, up to "
        f"{rounded(np.max(np.abs(samples.current)), 4)} A).",
        "is the current in mA, or the time in ms? Then say --unit current=mA or --unit time=ms (or --unit current=A if "
        "that is right).",
    )
