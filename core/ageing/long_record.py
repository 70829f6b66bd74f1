"""From the samples of a whole life to what is compared of it."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import BsaError
from ..trajectory import Trajectory
from .choice import kept_cycles
from .summary import in_sequence, line_of, table_of


def long_record(whole: Trajectory, wanted: Sequence[int] | None = None) -> Trajectory:
    """A record as its cycle table and the curves of a few cycles.

    Parameters
    ----------
    whole : Trajectory
        All cycles, cut into steps.
    wanted : sequence of int, optional
        The cycles whose curves are kept; left out, the first, the last, the bends of the fade, and some between.

    Raises
    ------
    BsaError
        If no cycle has a discharge, or a wanted cycle does not exist.
    """
    table = table_of([line_of(number, whole.cycle(number)) for number in whole.cycles])
    if table is None:
        raise BsaError("the record has no discharge.", "a record of ageing needs cycles with a discharge each.")
    kept = kept_cycles(whole.cycles[-1], table) if wanted is None else tuple(sorted(set(wanted)))
    return in_sequence([(number, whole.cycle(number)) for number in kept], table)
