"""Records that do not bring their charge back: an offset of their current is taken off, and searched."""

from dataclasses import replace

from ...core.parameters import Parameter
from ...core.reading.charge import UnreturnedCharge, unreturned_charge
from ...core.record import Record
from ...core.target import CurrentOffset, current_offset_name
from ...core.trajectory import with_offset
from .record_request import RecordRequest

_UNCERTAIN = 0.5
"""Standard deviation of what is left of an offset, as a share of the offset: the two rest voltages are up to 30 mV
apart, some percent of the charge of usual cells, where five percent and more is missing."""

_LARGEST = 2.0
"""Standard deviations by which it is off at most: no offset, or twice the offset."""


def without_current_offset(request: RecordRequest, record: Record) -> Record:
    """The record less the offset that would bring its charge back, if nothing was said of its offset."""
    found = _unreturned(request, record)
    if found is None:
        return record
    whole = record.trajectory
    current = with_offset(whole.current, -found.offset_a)
    note = (
        f"an offset of {-1e3 * found.offset_a:+.2g} mA (positive on charge) is taken off the current wherever one "
        "passes; if the record is fitted, the rest of the offset is searched (--current-offset 0 keeps the current)."
    )
    return replace(record, trajectory=whole.changed(current=current), notes=(*record.notes, note))


def searched_offset(request: RecordRequest, name: str) -> Parameter | None:
    """What the current of a fitted record of this name may still be off by; None where its charge came back as read."""
    record = request.source
    found = _unreturned(request, record) if isinstance(record, Record) else None
    if found is None:
        return None
    deviation = _UNCERTAIN * abs(found.offset_a)
    largest, target = _LARGEST * deviation, CurrentOffset(name)
    return Parameter(current_offset_name(name), 0.0, -largest, largest, target=target, deviation=deviation, prior=True)


def _unreturned(request: RecordRequest, record: Record) -> UnreturnedCharge | None:
    """The charge that a record as it was read does not bring back, where an offset of its current is not given."""
    if request.protocol is not None or request.is_life or request.reading.options.current_offset_a is not None:
        return None
    return unreturned_charge(record.trajectory)
