import numpy as np
from bsa.core.trajectory import Trajectory


def test_a_measurement_is_the_same_whatever_is_made_of_it() -> None:
    time = np.arange(5.0)
    record = Trajectory(time, np.ones(5), 4.0 - 0.01 * time, 298.15 + time)
    assert record.is_same_measurement(record.changed(temperature=299.0 + time))
    assert record.is_same_measurement(record.changed(time=time + 100.0))
    assert not record.is_same_measurement(record.changed(voltage=record.voltage + 1e-6))
    assert not record.is_same_measurement(record.changed(current=2.0 * record.current))
    assert not record.is_same_measurement(record.slice(0, 4))
