"""Where a record is silent for so long that an unknown charge may have passed."""

import numpy as np
from numpy.typing import NDArray

from ..printable import counted
from ..segmentation.holds import HOLD_BAND_V
from ..trajectory import SECONDS_PER_HOUR, FloatArray, Trajectory, drawn_between
from .samples import Samples

GAP_S = 900.0
"""Silence longer than this (and twenty usual intervals) is a gap, in s."""

FLOWS = 0.02
"""Share of the largest current above which a current flows, and no noise; so much is a change of it, too."""

_HOLD_CHARGE = 0.02
"""In a hold the charge lies between that of the current before a silence and that of the current after it. Up to this
share of the largest charge that passes one way, the two are near enough: a straight line is then off by half of it at
most, 1 % of the cell's charge, which moves the open-circuit voltage by some 10 mV."""


def gaps_in(record: Samples | Trajectory) -> NDArray[np.intp]:
    """The samples after which a record is silent for long, times rising.

    A hold at constant voltage that is written only when its current has fallen by a step is not silent: its voltage is
    the same and its current smaller afterwards. After a pause, in which the cell relaxes, it would be larger.
    """
    spacing = np.diff(record.time)
    if len(spacing) == 0:
        return np.zeros(0, dtype=np.intp)
    long = np.flatnonzero(spacing > max(GAP_S, 20.0 * float(np.median(spacing))))
    return long[~_held(record, long)] if len(long) else long


def _held(record: Samples | Trajectory, places: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether the silences after these samples are parts of a hold, and the charge in them is known well enough."""
    time, current, voltage = record.time, record.current, record.voltage
    before, after = current[places], current[places + 1]
    falls = np.sign(before) * (before - after)
    noise = FLOWS * float(np.max(np.abs(current)))
    hold = (before * after > 0.0) & (falls > noise) & (np.abs(voltage[places + 1] - voltage[places]) < HOLD_BAND_V)
    between = falls * (time[places + 1] - time[places]) / SECONDS_PER_HOUR
    return np.asarray(hold & (between < _HOLD_CHARGE * _largest_charge(time, current, places)))


def _largest_charge(time: FloatArray, current: FloatArray, silent: NDArray[np.intp]) -> float:
    """The largest charge that passes one way without a rest or a silence, A.h."""
    passed = drawn_between(time, current) / SECONDS_PER_HOUR
    passed[silent] = 0.0
    starts = np.union1d([0], np.union1d(np.flatnonzero(np.diff(np.sign(current))), silent))
    return float(np.max(np.abs(np.add.reduceat(passed, starts))))


def with_gaps_noted(samples: Samples) -> Samples:
    """Note long silences; nothing is filled in."""
    spacing, gaps = np.diff(samples.time), gaps_in(samples)
    if len(gaps) == 0:
        return samples
    scale = float(np.max(np.abs(samples.current)))
    flowing = np.minimum(np.abs(samples.current[gaps]), np.abs(samples.current[gaps + 1])) > FLOWS * scale
    k = int(gaps[np.argmax(spacing[gaps])])
    longest = f"{spacing[k]:.0f}" if spacing[k] >= 1000.0 else f"{spacing[k]:.4g}"
    note = f"{counted(len(gaps), 'gap')} without samples, the longest of {longest} s after {samples.place(k)}"
    if flowing.any():
        which = "it" if len(gaps) == 1 else f"{np.count_nonzero(flowing)} of them"
        note += f"; current flowed across {which}, so charge is uncertain there"
    return samples.noted(note + ".")
