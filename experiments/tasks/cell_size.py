"""How large the cell is that the records were measured on, by the charge that they pass."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.printable import rounded
from ...core.record import Record
from ...core.segmentation.recognised_protocol import with_switches
from ...core.task import CellModel
from .cell_for_records import NEAR_POTENTIALS_V, WIDTH, is_whole, span_ah, whole_cycles
from .record_request import RecordRequest
from .record_start import open_circuit_start, starts_at_rest

_SAME_SIZE = (0.8, 1.25)
"""Ratios of measured to nominal capacity of two cells of one type."""

_HOLDS_MORE = 1.02
"""Ratio from which on a fit begins with a larger cell: counters of charge agree within 2 %. One that is too small runs
empty before its record ends, which tells a fit little but that: two fits of drawn cells, 3 and 9 % too small, ended at
31 and 5 mV after 100 simulations from the right size, and at 103 and 33 from their own. What a record does not take out
of a cell may still be in it: down to the ratio of two cells of one type the search finds the size."""

_FAR_LARGER, _LARGE_AH = 100.0, 100.0
"""Ratio of capacities, and charge, from which on a current in mA that is taken for one in A is a likely reason: few
cells hold as much. Sets are of cells of 0.12 to 5 A.h, of which the smallest is scaled a hundredfold to a usual one."""

_KNOWN_SOC = 0.1
"""Width of the states of charge within which a first voltage tells where a record starts. On the plateau of a LiFePO4
cell the same millivolts span half of the charge."""


_HALF = 0.5
"""A cell that starts fuller tells its charge by what it gives from there on, an emptier one by what it takes: of the
smaller share an error of the start would be a large one."""


def size_factor(
    records: Sequence[Record], values: Any, capacity_ah: float, starts: Sequence[float | None]
) -> tuple[float, str]:
    """How much larger the measured cell is than the parameter set's, and a sentence if that matters.

    ``starts`` are the states of charge at which the records start, where known: a cell that starts part full holds
    more than it gives.
    """
    found = [(span_ah(cycle), "") for cycle in whole_cycles(records, values)]
    for record, soc in zip(records, starts, strict=True):
        found += _from_start(record, values, soc)
    if not found:
        return 1.0, ""
    charge_ah, why = max(found, key=lambda one: one[0])  # of equal ones the first, without a reason
    ratio = charge_ah / capacity_ah
    if _SAME_SIZE[0] <= ratio <= _HOLDS_MORE:
        return 1.0, ""
    return ratio, (
        f"The records hold {rounded(charge_ah, 3)} A.h{why}, the parameter set's cell "
        f'{rounded(capacity_ah, 3)} A.h: "{WIDTH}" starts from {rounded(ratio, 3)} times its value '
        "(--no-scale keeps it)."
        + " Is the current in mA? Then say --unit current=mA."
        * (ratio >= _FAR_LARGER and charge_ah >= _LARGE_AH)
    )


def _from_start(record: Record, values: Any, soc: float | None) -> list[tuple[float, str]]:
    """The charge in A.h that a cell holds by its first cycle, and how that follows.

    Nothing where the cycle does not cross most of the voltage window, or starts at an unknown charge.
    """
    first = record.trajectory.cycle(record.trajectory.cycles[0])
    if soc is None or not is_whole(first, values):
        return []
    drawn = with_switches(first).discharge_capacity
    passed, share = (float(np.max(drawn)), soc) if soc > _HALF else (-float(np.min(drawn)), 1.0 - soc)
    holds = passed / share
    from_part = f" ({rounded(passed, 3)} A.h pass from a state of charge of {soc:.3g} on)"
    return [(holds, from_part * (f"{holds:.3g}" != f"{passed:.3g}"))]


def starting_soc(cell: CellModel, request: RecordRequest, record: Record) -> float | None:
    """The state of charge at which a record starts, None where neither a person nor its first voltage tells."""
    from ...plugins.pybamm.cells.state_of_charge import socs_at_voltages

    if request.initial_soc is not None or not request.as_measured:
        return request.initial_soc
    voltage = request.initial_voltage
    if voltage is None:
        if not starts_at_rest(record.trajectory):
            return None
        voltage, _ = open_circuit_start(record.trajectory)
    around = (voltage - NEAR_POTENTIALS_V, voltage, voltage + NEAR_POTENTIALS_V)
    low, soc, high = socs_at_voltages(cell, around, record.ambient_k)
    return soc if high - low <= _KNOWN_SOC else None


def other_size_note(record: Record, values: Any, capacity_ah: float) -> str:
    """That a record which is not fitted holds another charge than the cell that is to predict it; empty if it does not.

    A prediction scales nothing: a record of another cell is off by the charge alone.
    """
    spans = [span_ah(cycle) for cycle in whole_cycles([record], values)]
    if not spans or _SAME_SIZE[0] <= max(spans) / capacity_ah <= _SAME_SIZE[1]:
        return ""
    return (
        f"the record holds {rounded(max(spans), 3)} A.h, the cell of the fit {rounded(capacity_ah, 3)} A.h, nominally: "
        "is it a record of this cell?"
    )
