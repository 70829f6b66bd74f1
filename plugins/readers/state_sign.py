"""The sign of a current of which a file gives sizes: the state of each row tells it."""

import re
from collections.abc import Sequence

import numpy as np

from ...core.trajectory import FloatArray

NAMES = (
    *("state", "md", "status", "mode", "steptype", "stepname", "stepmode", "workmode", "worktype"),
    *("工步类型", "工步名称", "状态", "工作模式"),
)
"""Names of the columns with the state of each row; folded, in order of preference."""

_DISCHARGE = re.compile(r"d(is|e|é)?_?ch|entlad|放|^d(is)?(?![^\W_])")
"""``D`` (Maccor), ``DCHG`` (Bitrode), ``D_CC`` and ``CC_DChg`` (LAND), ``CC discharge``, ``Entladen``, ``恒流放电``."""

_CHARGE = re.compile(r"ch(a|g|r)|laden|充|^c(?![^\W_])")


def with_signs(current: FloatArray, states: Sequence[str], discharge_positive: bool) -> FloatArray | None:
    """A current with the sign of the state of each row, shape (n,); a state that names none goes on as before.

    It is negative on discharge, or on charge where the person says that it is positive on discharge. None if the
    current has signs of its own, or no state names what would be negative.
    """
    if np.any(current < 0.0):
        return None
    signs = {state: _sign(state.strip().casefold()) for state in set(states)}
    negative = 1 if discharge_positive else -1
    if negative not in signs.values():
        return None
    told = np.array([signs[state] for state in states])
    last = np.maximum.accumulate(np.where(told != 0, np.arange(len(told)), 0))
    return np.where(told[last] == negative, 0.0 - current, current)


def _sign(state: str) -> int:
    """-1 on discharge, 1 on charge, 0 where the state says neither."""
    if _DISCHARGE.search(state):
        return -1
    return 1 if _CHARGE.search(state) else 0
