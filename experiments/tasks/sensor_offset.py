"""What a temperature sensor reads at the start of a record apart from the ambient temperature."""

from ...core.reading.ambient import starts_warm
from ...core.task import Experiment
from ...core.trajectory import Trajectory

_NOTED_K = 0.1
"""Smallest offset worth a note, K: sensors resolve it."""

_SENSORS_K = 3.0
"""Largest difference that thermocouples and chambers explain, K. Beyond it the cell itself was warm, or cold."""


def initial_temperature_k(record: Trajectory, ambient_k: float | None) -> float | None:
    """The temperature of the cell at the start of a record, K, where sensors do not explain that it is no ambient one.

    Such a cell cools later on, or is further off than any sensor.
    """
    if ambient_k is None or record.temperature is None:
        return None
    first = float(record.temperature[0])
    warm = first > ambient_k and starts_warm(record.time, record.temperature)
    return first if warm or abs(first - ambient_k) > _SENSORS_K else None


def from_ambient(record: Trajectory, ambient_k: float | None) -> Trajectory:
    """The record with a temperature that starts at the ambient one, unless the cell itself was warm or cold.

    The simulated cell starts at the ambient temperature. A fit has no parameter for a sensor that reads half a kelvin
    more, and a cell that never cools shows just that.
    """
    if ambient_k is None or record.temperature is None or initial_temperature_k(record, ambient_k) is not None:
        return record
    offset = float(record.temperature[0]) - ambient_k
    return record.changed(temperature=record.temperature - offset) if abs(offset) >= _NOTED_K else record


def start_note(name: str, record: Trajectory, experiment: Experiment) -> list[str]:
    """What is to be said of the temperature at which a record starts: that of a warm cell, or one that is shifted."""
    compared = experiment.target
    if record.temperature is None or compared.temperature is None or experiment.temperature_k is None:
        return []
    if experiment.initial_temperature_k is not None:
        return [
            f"{name}: the cell starts {_beside(experiment.initial_temperature_k - experiment.temperature_k)} the "
            "ambient temperature; a thermal model starts there too."
        ]
    offset = float(record.temperature[0] - compared.temperature[0])
    if offset == 0.0:
        return []
    return [
        f"{name}: the measured temperature starts {_beside(offset)} the ambient one; it is compared as a rise from its "
        "start."
    ]


def _beside(kelvin: float) -> str:
    return f"{abs(kelvin):.1f} K {'above' if kelvin > 0 else 'below'}"
