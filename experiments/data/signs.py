"""What a record says with the sign of cyclers: current positive on charge."""

from dataclasses import replace

from ...core.reading.summary import RecordSummary


def positive_on_charge(found: RecordSummary) -> RecordSummary:
    """The same with currents and charges that are positive on charge, as all that ``bsa data`` prints has them."""
    least, largest = found.current
    return replace(
        found,
        current=(_turned(largest), _turned(least)),
        steps=tuple(
            replace(row, current_a=_turned(row.current_a), charge_ah=_turned(row.charge_ah)) for row in found.steps
        ),
        resistances=tuple(replace(row, current_change_a=_turned(row.current_change_a)) for row in found.resistances),
    )


def _turned(value: float) -> float:
    return -value + 0.0  # no -0.0
