"""A few samples that stand for many."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

ROUNDING = 1e-6
"""Share of its size by which a constant signal may vary: samples are rounded, to 6e-8 at single precision."""

SAMPLES_OF_DRIVES = 1600
"""Samples of all steps of a varying current that a stored or drawn curve keeps: two for each pixel of a drawing 800
pixels wide, the lowest and the highest that show there."""


def evenly(count: int, most: int) -> NDArray[np.intp]:
    """Indices of at most so many of ``count`` samples, evenly spread, both ends among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.intp))


def where_they_bend(time: NDArray[np.float64], curves: Sequence[NDArray[np.float64]], most: int) -> NDArray[np.intp]:
    """Indices of at most so many samples of curves over one time: half evenly spread, half where the curves bend.

    Straight lines between the samples that are kept come as close to the curves as so few can: each further sample is
    the one that lies farthest from them. ``curves``, of shape (n,), have a range of about one.
    """
    kept = evenly(len(time), most if most < 4 else most // 2)
    while len(kept) < min(most, len(time)):
        off = np.zeros(len(time))
        for curve in curves:
            off = np.maximum(off, np.abs(curve - np.interp(time, time[kept], curve[kept])))
        off[kept] = 0.0
        worst = np.maximum.reduceat(off, kept[:-1])
        # Several at once, those of about the size of the largest: what a sample changes ends at its neighbours.
        places = np.flatnonzero((worst > 0.5 * worst.max()) & (worst > ROUNDING))
        places = places[np.argsort(-worst[places], kind="stable")][: most - len(kept)]
        if len(places) == 0:
            break
        further = [kept[place] + int(np.argmax(off[kept[place] : kept[place + 1]])) for place in places]
        kept = np.union1d(kept, np.array(further, dtype=np.intp))
    return kept
