"""Whether the voltage goes on rising, in long rests after a discharge, longer than a simulated one."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ..trajectory import FloatArray, StepKind, Trajectory

_LONG_REST_S = 1800.0
"""Rest that tells slow relaxation from that of particles and electrolyte, which takes minutes."""

_EARLY = 0.1
"""Share of the rest, from its beginning, that has the relaxation that every model has, and what is left of the knee of
the discharge."""

GOES_ON_V = 0.03
"""Rise of the measured voltage beyond the simulated one, in such a rest, that is told: twice the 15 mV by which
published potentials of one chemistry differ. Of 19 rests of two cells five show 67 to 140 mV and all others none."""


def rises_beyond(record: Trajectory, time: FloatArray, error: FloatArray) -> Iterator[float]:
    """For each long rest behind a discharge: rise of the measured voltage beyond the simulated one, V.

    ``time`` and ``error`` are when the two were compared, on the record's clock, s, and measured minus simulated
    voltage, V; shape (n,).
    """
    for before, rest in pairwise(record.steps):
        if (before.kind, rest.kind) != (StepKind.CC_DISCHARGE, StepKind.REST):
            continue
        begin, end = record.time[rest.start], record.time[rest.stop - 1]
        inside = (time >= begin) & (time <= end)
        if end - begin >= _LONG_REST_S and np.count_nonzero(inside) > 1:
            early = np.interp(begin + _EARLY * (end - begin), time[inside], error[inside])
            yield float(error[inside][-1] - early)
