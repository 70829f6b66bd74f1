"""A voltage that does not answer the current: that of a set point, or of another column."""

import numpy as np

from .samples import Samples

_STILL_V = 1e-3
"""A voltage that moves by no more than this over a whole record stands still, in V: a cell of 1 mohm moves by more."""

_JUMP = 0.5
"""A change of the current by more than this share of the largest is a switch, which every cell answers. In a hold at a
constant voltage, where a voltage stands still too, the current falls slowly."""


def still_voltage_note(samples: Samples) -> list[str]:
    """What is to be said of a voltage that stands still while the current is switched."""
    largest = float(np.max(np.abs(samples.current), initial=0.0))
    if largest == 0.0 or float(np.ptp(samples.voltage)) > _STILL_V:
        return []
    if not np.any(np.abs(np.diff(samples.current)) > _JUMP * largest):
        return []
    return [
        f"column {samples.column('voltage')} stays at {float(np.median(samples.voltage)):.3f} V while the current "
        "switches, which no cell does: is it a set point? Then say which column is measured with --column voltage=NAME."
    ]
