"""The temperature around a cell: what was measured there while a current flowed, else what the cell cools to."""

import numpy as np
from scipy.constants import zero_Celsius

from ..trajectory import FloatArray
from .gaps import FLOWS

WARM_K = 1.0
"""Fall of a cell's temperature below its first sample that shows a cell warmer than its surroundings, K. Sensors, the
regulation of a chamber and reversible heat explain less: the cells of the LG M50 fall by up to 0.7 K, those of NASA's
charges, which follow a discharge, by 2 to 5 K."""

HOT_C = 60.0
"""Cells are rarely tested in a hotter chamber, degC; what a room has in degF is above it."""

SPAN_K = 3.0
"""What a chamber or a room varies by during a test, K: where it is more, there were several temperatures."""

_DAY_S = 86400.0

_BLOCK, _LEAST_BLOCKS = 9, 5
"""Samples of which the median counts as one, so that a lone glitch does not; of a short record fewer."""


_ENDS = (0.01, 0.99)
"""Shares of the samples below its lowest and its highest value: a lone glitch does not count."""


def lowest_k(time: FloatArray, temperature: FloatArray) -> float:
    """What a cell's temperature falls to on a usual day of its record, K.

    A cell that heats itself is no colder than what is around it, but for noise and little reversible heat. A room is
    not the same every day: the lowest of many would not be that of the others.
    """
    days = np.floor((time - time[0]) / _DAY_S)
    return float(np.median([_lowest(temperature[days == day]) for day in np.unique(days)]))


def starts_warm(time: FloatArray, temperature: FloatArray) -> bool:
    """Whether a record begins with a cell that is warmer than its surroundings, as after another test."""
    return float(temperature[0]) - lowest_k(time, temperature) > WARM_K


def ambient_of(time: FloatArray, temperature: FloatArray) -> tuple[float, str]:
    """The temperature around a cell by that of the cell itself, K, and what is to be said of it."""
    first = float(temperature[0])
    if not starts_warm(time, temperature):
        return first, f"the ambient temperature is taken to be that of the first sample, {_celsius(first)}."
    lowest = lowest_k(time, temperature)
    return lowest, (
        f"the cell starts at {_celsius(first)} and cools: the ambient temperature is taken to be the lowest that it "
        f"reaches, {_celsius(lowest)} (--temperature says another)."
    )


def measured_ambient(ambient: FloatArray, current: FloatArray) -> tuple[float | None, str]:
    """The temperature that was measured around a cell, K, and what is to be said of it.

    It is the median while a current flows: before, the chamber may not have reached it. Shapes are (n,); None where no
    sample has a number.
    """
    known = np.isfinite(ambient)
    flows = known & (np.abs(current) > FLOWS * np.max(np.abs(current), initial=0.0))
    used = ambient[flows if flows.any() else known]
    if len(used) == 0:
        return None, ""
    middle = float(np.median(used))
    lowest, highest = (float(end) for end in np.quantile(used, _ENDS))
    if highest - lowest <= SPAN_K:
        return middle, ""
    return middle, (
        f"the ambient temperature in the file goes from {_celsius(lowest)} to {_celsius(highest)} while a current "
        f"flows; the median, {_celsius(middle)}, is taken for the whole record (--cycles or --where choose a part)."
    )


def _celsius(kelvin: float) -> str:
    return f"{kelvin - zero_Celsius:.1f} degC"


def _lowest(temperature: FloatArray) -> float:
    block = max(1, min(_BLOCK, len(temperature) // _LEAST_BLOCKS))
    whole = len(temperature) - len(temperature) % block
    return float(np.median(temperature[:whole].reshape(-1, block), axis=1).min())
