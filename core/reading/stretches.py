"""The stretches of a record under a current of one direction."""

import numpy as np
from numpy.typing import NDArray

from ..trajectory import FloatArray
from .gaps import FLOWS, gaps_in
from .samples import Samples

Places = NDArray[np.intp]

_JUMP = 0.05
"""A change of the current by more than this share of the largest, from one sample to the next, is a jump."""


def directions(current: FloatArray) -> FloatArray:
    """The sign of the current at each sample, 0 where none flows."""
    return np.where(np.abs(current) > FLOWS * np.max(np.abs(current)), np.sign(current), 0.0)


def stretches(samples: Samples) -> tuple[Places, Places]:
    """First and last samples of each stretch under a current of one direction.

    What happened in a gap is not known, so that one ends a stretch: a charge may stand between two discharges.
    """
    return _between(samples, np.flatnonzero(np.diff(directions(samples.current))))


def steady_stretches(samples: Samples) -> tuple[Places, Places]:
    """First and last samples of each stretch under a current without a jump.

    The sample right behind a jump is left out, whose voltage may be that of before it.
    """
    jumps = np.abs(np.diff(samples.current)) > _JUMP * np.max(np.abs(samples.current))
    first, last = _between(samples, np.flatnonzero((np.diff(directions(samples.current)) != 0) | jumps))
    return np.minimum(first + 1, last), last


def _between(samples: Samples, ends: Places) -> tuple[Places, Places]:
    cuts = np.union1d(ends, gaps_in(samples)) + 1
    edges = np.concatenate([[0], cuts, [len(samples)]]).astype(np.intp)
    first, last = edges[:-1], edges[1:] - 1
    flowing = directions(samples.current)[first] != 0
    return first[flowing], last[flowing]
