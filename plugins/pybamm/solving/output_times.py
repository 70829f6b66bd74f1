"""When a simulation's voltage is asked for: an answer takes as long as a step of the integrator."""

import numpy as np
from numpy.typing import NDArray

from ....core.trajectory import FloatArray

_SHARE = 0.05
"""Distance of two times, as a share of the time since the current last changed: what relaxes over decades of time is
straight between them within its change by decade over 10,000."""

_LONGEST_S = 1.0
"""Distance at most where current flows, s: nothing tells beforehand when the cell will be empty."""


def output_times(times: FloatArray, stops: FloatArray, flows: NDArray[np.bool_]) -> FloatArray:
    """Those of the wanted times between which the voltage is a straight line, and the stops.

    Parameters
    ----------
    times : ndarray of shape (n,)
        When the voltage is wanted, s, never decreasing, between the first stop and the last.
    stops : ndarray of shape (m,)
        When the current jumps or bends, s, increasing; the first is the start.
    flows : ndarray of bool, shape (m - 1,)
        Whether current flows between two stops.

    Returns
    -------
    ndarray of shape (k,)
        Increasing, with all stops among them.
    """
    piece = np.searchsorted(stops, times, side="right") - 1
    age = times - stops[piece]
    straight = age > _LONGEST_S / _SHARE
    # Places on a scale on which times to keep are one apart.
    place = np.log(np.maximum(age, np.finfo(float).tiny)) / _SHARE
    long = straight & np.append(flows, True)[piece]
    place[long] = np.log(_LONGEST_S / _SHARE) / _SHARE + (age[long] - _LONGEST_S / _SHARE) / _LONGEST_S
    before = np.column_stack([piece[:-1], np.floor(place[:-1])])
    after = np.column_stack([piece[1:], np.floor(place[1:])])
    kept = np.append(True, np.any(before != after, axis=1)) if len(times) else np.empty(0, bool)
    return np.unique(np.concatenate([times[kept], stops]))
