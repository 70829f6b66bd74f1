import numpy as np
import pytest
from bsa.core.trajectory import Step, StepKind, Trajectory


@pytest.mark.parametrize(
    ("end_s", "steps", "words"),
    [
        (5400.0, (), "3 samples of current, voltage; 1.5 h"),
        (90.0, (Step(StepKind.REST, 0, 1), Step(StepKind.PULSE, 1, 3)), "; 90 s; 2 steps in 1 cycle"),
        (3.0, (Step(StepKind.SPECTRUM, 0, 3),), "voltage; 1 step in 1 cycle"),
    ],
)
def test_its_representation_has_no_arrays(end_s: float, steps: tuple[Step, ...], words: str) -> None:
    shown = repr(Trajectory(np.linspace(0.0, end_s, 3), np.zeros(3), np.ones(3), steps=steps))
    assert words in shown
    assert "array" not in shown


def test_a_measurement_is_the_same_whatever_is_made_of_it() -> None:
    time = np.arange(5.0)
    record = Trajectory(time, np.ones(5), 4.0 - 0.01 * time, 298.15 + time)
    assert record.is_same_measurement(record.changed(temperature=299.0 + time))
    assert record.is_same_measurement(record.changed(time=time + 100.0))
    assert not record.is_same_measurement(record.changed(voltage=record.voltage + 1e-6))
    assert not record.is_same_measurement(record.changed(current=2.0 * record.current))
    assert not record.is_same_measurement(record.slice(0, 4))


def test_a_thinned_record_keeps_what_stands_out_and_no_rounding() -> None:
    time = np.arange(1000.0)
    voltage = np.full(1000, 3.7)
    voltage[777] = 3.6
    current = 2.28 + 4e-16 * (np.arange(1000) % 2)
    thin = Trajectory(time, current, voltage, None, (Step(StepKind.DRIVE, 0, 1000),)).thinned(60)
    assert thin.voltage.min() == 3.6
    assert len(thin) < 40  # the even half, and the three corners of the spike
    assert thin.steps == (Step(StepKind.DRIVE, 0, len(thin)),)


def test_steps_of_a_varying_current_share_samples_by_their_length() -> None:
    time = np.arange(6000.0)
    current = np.where(np.arange(6000) % 7 == 0, 5.0, 0.0)
    kinds = ((StepKind.DRIVE, 0, 4000), (StepKind.CC_DISCHARGE, 4000, 5000), (StepKind.DRIVE, 5000, 6000))
    record = Trajectory(time, current, 4.0 - time / 6000, None, tuple(Step(*kind) for kind in kinds))
    thin = record.thinned(60, 1000)
    assert [step.stop - step.start for step in thin.steps] == [800, 60, 200]
    assert [step.stop - step.start for step in record.thinned(60).steps] == [60, 60, 60]
