"""Levels of a constant current whose readings wobble: where the voltage does not answer, they are one level."""

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from ..trajectory import StepKind
from .levels import ANSWERED, LEVEL_SHARE, Level, RecordSignals, answer

_CONSTANT = 0.5
"""Share of the samples within the tolerance of the median from which a row of levels is meant to be one."""

_CHANGES = 30
"""Changes of the current whose answer can be judged at least: of so many that have none, the correlation is 0.2 at
most."""


def without_wobbles(signals: RecordSignals, levels: list[Level]) -> list[Level]:
    """Join neighbouring levels of one sign between which the current changes often and the voltage does not answer."""
    joined: list[Level] = []
    for sign, found in groupby(levels, key=lambda level: level.sign):
        row = list(found)
        first, last = _ends_of_constant(signals, row) if sign != 0 and len(row) > 1 else (0, 0)
        if first < last and _wobbles(signals, row[first : last + 1]):
            whole = signals.level(row[first].start, row[last].stop, sign)
            whole.kind = StepKind.CC_CHARGE if sign < 0 else StepKind.CC_DISCHARGE
            row[first : last + 1] = [whole]
        joined += row
    return joined


def _ends_of_constant(signals: RecordSignals, row: Sequence[Level]) -> tuple[int, int]:
    """Places of the first and the last long level at the usual current: behind them a voltage may be held."""
    usual = _usual(signals, row)
    near = [k for k, level in enumerate(row) if level.long and abs(level.mean - usual) <= signals.tolerance(usual)]
    return (near[0], near[-1]) if near else (0, 0)


def _usual(signals: RecordSignals, row: Sequence[Level]) -> float:
    return float(np.median(signals.current[row[0].start : row[-1].stop]))


def _wobbles(signals: RecordSignals, row: Sequence[Level]) -> bool:
    part, usual = slice(row[0].start, row[-1].stop), _usual(signals, row)
    current = signals.current[part]
    if np.mean(np.abs(current - usual) <= signals.tolerance(usual)) < _CONSTANT:
        return False
    changes, moves = np.diff(current), np.diff(signals.voltage[part])
    large = np.abs(changes) > 0.5 * LEVEL_SHARE * abs(usual)
    return int(np.count_nonzero(large)) >= _CHANGES and answer(changes[large], moves[large]) < ANSWERED
