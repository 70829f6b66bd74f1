"""The cycle that a life repeats: what a cycler was told, and which of its cycles were carried out like that."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from scipy.stats import theilslopes

from ..segmentation.recognised_protocol import SeenStep, seen_steps, voltage_limits
from ..trajectory import FloatArray, Trajectory
from .cycle_table import CycleTable

_CUT_SHORT = 0.97
"""Share of the capacity of the cycles around it below which a cycle was cut short: cells fade by less within days, and
recover by less after pauses."""

_HALF = 0.5

_AROUND = 15
"""Cycles whose median says what is usual."""


@dataclass(frozen=True)
class TypicalCycle:
    """The cycle that a life repeats."""

    steps: tuple[str, ...]  # As PyBaMM step strings.
    numbers: tuple[int, ...]  # The cycles that have these steps.


def typical_cycle(whole: Trajectory, name: str) -> TypicalCycle:
    """The most frequent sequence of steps, each with the median of its currents, voltages and durations.

    ``whole`` is cut into steps that begin where the one before ended; ``name`` is the record's, for messages. Raises
    `BsaError` if a step is none that a protocol has, such as a drive cycle.
    """
    limits = voltage_limits(whole)
    kinds = {number: tuple(step.kind for step in whole.cycle(number).steps) for number in whole.cycles}
    ((usual, _),) = Counter(kinds.values()).most_common(1)
    numbers = tuple(number for number, found in kinds.items() if found == usual)
    seen = [seen_steps(whole.cycle(number), limits, name) for number in numbers]
    return TypicalCycle(tuple(str(_median(steps)) for steps in zip(*seen, strict=True)), numbers)


def _median(steps: tuple[SeenStep, ...]) -> SeenStep:
    def middle(quantity: str) -> float:
        return float(np.median([getattr(step, quantity) for step in steps]))

    return SeenStep(
        kind=steps[0].kind,
        seconds=middle("seconds"),
        amperes=middle("amperes"),
        volts=middle("volts"),
        last_volts=middle("last_volts"),
        last_amperes=middle("last_amperes"),
        at_limit=middle("at_limit") > _HALF,
        falls=middle("falls") > _HALF,
    )


def without_cut_short(table: CycleTable) -> CycleTable:
    """The table without cycles whose capacity lies far below that of the cycles around them."""
    capacity = table.capacity_ah
    padded = np.concatenate([_beyond(capacity[::-1])[::-1], capacity, _beyond(capacity)])
    usual = np.median(np.lib.stride_tricks.sliding_window_view(padded, _AROUND), axis=1)
    return table.lines(capacity > _CUT_SHORT * usual)


def _beyond(capacity: FloatArray) -> FloatArray:
    """The capacities of half a window of cycles behind the last one, if the fade went on as before.

    On a line with the median of all slopes between the nearest cycles, to which one or two that were cut short are
    nothing. The last capacity itself, repeated, would be its own median, and mirrored capacities would leave out the
    last cycle of a fast fade: on the first n cycles of CALCE CS2_35 and CS2_36, 45 and 71 times, the line 2 and 12.
    """
    half = _AROUND // 2
    nearest = capacity[-half - 1 :]
    if len(nearest) < 2:
        return np.full(half, nearest[-1])
    slope, at_first, *_ = theilslopes(nearest)
    return np.asarray(at_first + slope * (len(nearest) + np.arange(half)))
