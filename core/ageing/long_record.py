"""From the samples of a whole life to what is compared of it."""

from collections.abc import Collection, Sequence

from ..errors import BsaError
from ..segmentation.recognised_protocol import with_switches
from ..trajectory import Trajectory
from .choice import kept_cycles
from .cycle_table import CycleTable
from .summary import discharged_ah, in_sequence, line_of, table_of


def long_record(whole: Trajectory, wanted: Sequence[int] | None = None) -> Trajectory:
    """A record as its cycle table and the curves of a few cycles.

    ``wanted`` are the cycles whose curves are kept; left out, the first, the last, the bends of the fade, and some
    between. Raises `BsaError` if no cycle has a discharge, or a wanted cycle does not exist.
    """
    table = measured_table(whole, whole.cycles)
    kept = kept_cycles(whole.cycles[-1], table) if wanted is None else tuple(sorted(set(wanted)))
    return with_curves(whole, table, kept)


def measured_table(whole: Trajectory, numbers: Collection[int]) -> CycleTable:
    """The cycle table of a measured record.

    A cycler's first sample of a step may be late. The charge is that from the switch on; a resistance is told only
    where the sample is prompt.

    Raises `BsaError` if none of the cycles has a discharge.
    """
    lines = []
    for number in numbers:
        cycle = whole.cycle(number)
        _, _, *others = line_of(number, cycle)
        lines.append((number, discharged_ah(with_switches(cycle)), *others))
    table = table_of(lines)
    if table is None:
        raise BsaError("the record has no discharge.", "a record of ageing needs cycles with a discharge each.")
    return table


def with_curves(whole: Trajectory, table: CycleTable, kept: Sequence[int]) -> Trajectory:
    """The curves of some cycles, each step from its switch on, with a cycle table.

    Raises `BsaError` if one of the cycles does not exist.
    """
    return in_sequence([(number, with_switches(whole.cycle(number))) for number in kept], table)
