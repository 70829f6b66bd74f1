"""Curves with few points that look the same."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.trajectory import FloatArray

_BUCKETS = 500
"""Places along x that are told apart: less than two pixels each in a chart's width."""

_INVISIBLE = 0.15
"""Pixels by which a curve may differ from the drawn one without being seen to."""


def thin_curve(x: FloatArray, y: FloatArray, most: int) -> NDArray[np.intp]:
    """Indices of the points that matter when a curve is drawn (Ramer-Douglas-Peucker).

    ``x`` and ``y``, of shape (n,), are in pixels, ``x`` never decreasing. The indices increase, are ``most`` at most,
    and both ends are among them.
    """
    index = _extremes(x, y)
    x, y = x[index], y[index]
    matters = np.zeros(len(index))
    matters[[0, -1]] = np.inf
    stack = [(0, len(index) - 1, np.inf)]
    while stack:
        first, last, limit = stack.pop()
        if last - first < 2:
            continue
        away = _distance(x[first : last + 1], y[first : last + 1])
        farthest = int(np.argmax(away))
        # A point matters no more than the one whose removal would remove it, too.
        limit = min(limit, float(away[farthest]))
        if limit < _INVISIBLE:
            continue
        matters[first + farthest] = limit
        stack += [(first, first + farthest, limit), (first + farthest, last, limit)]
    kept = np.flatnonzero(matters > 0)
    if len(kept) > most:
        kept = np.sort(kept[np.argsort(-matters[kept], kind="stable")[:most]])
    return index[kept]


def _extremes(x: FloatArray, y: FloatArray) -> NDArray[np.intp]:
    """First, lowest, highest and last point of every bucket along x: what a dense curve covers."""
    if len(x) <= 4 * _BUCKETS:
        return np.arange(len(x))
    edges = np.unique(np.searchsorted(x, np.linspace(x[0], x[-1], _BUCKETS + 1)).clip(0, len(x) - 1))
    picks = [np.array([0, len(x) - 1])]
    for first, last in pairwise(edges):
        piece = y[first:last]
        picks.append(first + np.array([0, int(np.argmin(piece)), int(np.argmax(piece)), last - first - 1]))
    return np.unique(np.concatenate(picks))


def _distance(x: FloatArray, y: FloatArray) -> FloatArray:
    """How far each point lies from the line through the ends."""
    dx, dy = x[-1] - x[0], y[-1] - y[0]
    length = float(np.hypot(dx, dy))
    if length == 0.0:
        return np.asarray(np.hypot(x - x[0], y - y[0]))
    return np.asarray(np.abs(dx * (y - y[0]) - dy * (x - x[0])) / length)
