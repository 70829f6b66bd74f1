"""What rounding and sampling hide of a measured current: over many cycles the charge adds up."""

import math
from functools import lru_cache

import numpy as np

from ..comparison.noise import resolution
from ..contracts.requests import MeasuredRecord
from ..parameters import Parameter
from ..taper import hidden_charge
from ..target import CurrentOffset

_COARSEST, _FINEST = 3e-4, 1e-5
"""Deviation of a current, as a share of its largest value: that of rounding is at most the one of three digits, for a
current that is written as one and the same number says nothing of its digits; and the whole is at least what moves the
charge by a hundredth of a percent in ten cycles, of which voltages show nothing."""

_LARGEST = 4.0
"""Deviations by which an offset may be off at most: half a step of the reading is 1.7, and sampling hides less than
one."""


@lru_cache(maxsize=64)  # asked for at every fit to a hold-out record
def current_offset(measured_record: MeasuredRecord) -> Parameter | None:
    """The offset of the current of a record of many cycles, with what rounding and sampling hide as its prior.

    A constant current is rounded the same way in every cycle, and the samples of a voltage hold miss the same charge in
    every cycle. None for other records: what is hidden there draws no charge that shows.
    """
    if not measured_record.is_long:
        return None
    record = measured_record.record
    peak = float(np.max(np.abs(record.current)))
    rounding = min(resolution(record.current), _COARSEST * peak)
    deviation = math.hypot(rounding, hidden_charge(record) / record.duration)
    if deviation < _FINEST * peak:
        return None
    largest, target = _LARGEST * deviation, CurrentOffset(measured_record.name)
    # A deviation moves the charge of ten cycles by more than an integrator is off.
    return Parameter(
        measured_record.offset_name,
        0.0,
        -largest,
        largest,
        target=target,
        deviation=deviation,
        prior=True,
        difference=1.0,
    )
