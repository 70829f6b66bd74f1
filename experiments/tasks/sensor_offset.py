"""What a temperature sensor reads apart from the ambient temperature of the record."""

from ...core.trajectory import Trajectory

_NOTED_K = 0.1
"""Smallest offset worth a note, K: sensors resolve it."""

_SENSORS_K = 3.0
"""Largest difference that thermocouples and chambers explain, K. Beyond it the cell was warm, or another ambient
temperature was meant, and nothing is shifted."""


def sensor_offset_k(record: Trajectory, ambient_k: float | None) -> float:
    """First measured temperature less the ambient one, K; 0 where there is none, or sensors do not explain it.

    The simulated cell starts at the ambient temperature. A fit has no parameter for a sensor that reads half a kelvin
    more, and a cell that never cools shows just that.
    """
    if ambient_k is None or record.temperature is None:
        return 0.0
    offset = float(record.temperature[0]) - ambient_k
    return offset if _NOTED_K <= abs(offset) <= _SENSORS_K else 0.0


def from_ambient(record: Trajectory, ambient_k: float | None) -> Trajectory:
    """The record with a temperature that starts at the ambient one."""
    offset = sensor_offset_k(record, ambient_k)
    if record.temperature is None or offset == 0.0:
        return record
    return record.changed(temperature=record.temperature - offset)


def offset_note(name: str, record: Trajectory, compared: Trajectory) -> list[str]:
    """What is to be said of the shift of a record that is compared as `from_ambient` has it."""
    if record.temperature is None or compared.temperature is None:
        return []
    offset = float(record.temperature[0] - compared.temperature[0])
    if offset == 0.0:
        return []
    return [
        f"{name}: the measured temperature starts {abs(offset):.1f} K {'above' if offset > 0 else 'below'} the ambient "
        "one; it is compared as a rise from its start."
    ]
