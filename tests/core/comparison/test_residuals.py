from collections.abc import Sequence

import numpy as np
import pytest
from bsa.core.cell import CURRENT, TEMPERATURE, VOLTAGE
from bsa.core.comparison.residuals import noise_of_residuals, residuals, rows_of
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.rms import rms
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory

SPACE = ParameterSpace((Parameter("a", 1.0, 0.5, 2.0),))


def discharge_and_rest(rest_s: float) -> Trajectory:
    """A discharge of half an hour and a rest behind it, a sample every 10 s, at 298 K."""
    time = np.arange(0.0, 1800.0 + rest_s + 1.0, 10.0)
    current = np.where(time <= 1800.0, 1.0, 0.0)
    steps = (Step(StepKind.CC_DISCHARGE, 0, 181), Step(StepKind.REST, 181, len(time), position=1))
    return Trajectory(time, current, np.full_like(time, 3.7), np.full_like(time, 298.0), steps)


def thermal_task(record: Trajectory) -> Task:
    signals = (CURRENT, VOLTAGE, TEMPERATURE)
    return Task("t", CellModel("Chen2020"), SPACE, (Experiment("r", record),), signals=signals)


def temperature_residuals(record: Trajectory, measured_k: np.ndarray) -> np.ndarray:
    """Residuals of the temperature of the rest, where the simulation keeps its own."""
    task = thermal_task(record.changed(temperature=measured_k))
    found = residuals(task, Outcome((ExperimentRun(record),)))
    assert found is not None
    rows = rows_of(task)
    return found[(rows.signal == "temperature") & (rows.step == 1)]


def test_a_room_that_cools_hours_after_the_current_is_not_fitted() -> None:
    record = discharge_and_rest(rest_s=50_000.0)
    cooling = record.temperature - 10.0 * (record.time > 10_000.0)
    assert np.all(temperature_residuals(record, cooling) == 0.0)


@pytest.mark.parametrize("rest_s", [600.0, 50_000.0])
def test_the_cooling_of_the_cell_is_fitted(rest_s: float) -> None:
    record = discharge_and_rest(rest_s)
    warm = record.temperature + np.where(record.time > 1800.0, 5.0 * np.exp(-(record.time - 1800.0) / 600.0), 0.0)
    assert np.max(np.abs(temperature_residuals(record, warm))) > 1.0


@pytest.mark.parametrize("seconds", [1.0, 10.0, 30.0])
def test_of_the_noise_of_samples_means_keep_what_they_keep(seconds: float) -> None:
    time = np.arange(0.0, 7201.0, seconds)
    place = int(np.count_nonzero(time <= 3600.0))
    steps = (Step(StepKind.CC_DISCHARGE, 0, place), Step(StepKind.REST, place, len(time), position=1))
    clean = Trajectory(time, np.where(time <= 3600.0, 1.0, 0.0), np.full_like(time, 3.7), None, steps)
    rng = np.random.default_rng(7)
    found = []
    for _ in range(40):
        noisy = clean.changed(voltage=clean.voltage + rng.normal(0.0, 3e-3, len(time)))
        task = Task("t", CellModel("Chen2020"), SPACE, (Experiment("r", noisy),))
        found.append(residuals(task, Outcome((ExperimentRun(clean),))))
    assert rms(noise_of_residuals(task)) == pytest.approx(rms(np.array(found)), rel=0.15)


def pulsed(amperes: Sequence[float], ohm: float) -> Trajectory:
    """Pulses of 10 s between rests of 600 s, of a cell that is a resistance."""
    times, currents, steps, clock, count = [], [], [], 0.0, 0
    for current in amperes:
        for kind, flowing, seconds in ((StepKind.REST, 0.0, 600.0), (StepKind.PULSE, current, 10.0)):
            times.append(clock + np.linspace(0.0, seconds, 51)[1:])
            currents.append(np.full(50, flowing))
            steps.append(Step(kind, count, count + 50, position=len(steps)))
            clock, count = clock + seconds, count + 50
    current = np.concatenate(currents)
    return Trajectory(np.concatenate(times), current, 3.7 - ohm * current, None, tuple(steps))


def test_a_large_pulse_tells_a_resistance_no_better_than_a_smaller_one() -> None:
    amperes = (1.0, 5.0, 10.0, 20.0, 1.0)  # behind the last one is no rest
    task = Task("t", CellModel("Chen2020"), SPACE, (Experiment("r", pulsed(amperes, 0.03)),))
    rows, found = rows_of(task), residuals(task, Outcome((ExperimentRun(pulsed(amperes, 0.033)),)))
    assert found is not None
    pulses = [float(np.sqrt(np.mean(found[rows.step == place] ** 2))) for place in (1, 3, 5, 7)]
    # Of 3 mohm too many 20 A show 60 mV, and 1 A shows 3 mV.
    assert pulses == sorted(pulses)
    assert pulses[3] < 1.1 * pulses[2]
    assert pulses[3] < 3.0 * pulses[0]
    # Errors that are small against a pulse count as they are.
    offset = pulsed(amperes, 0.03)
    moved = residuals(task, Outcome((ExperimentRun(offset.changed(voltage=offset.voltage + 1e-3)),)))
    assert moved is not None
    assert np.abs(moved) == pytest.approx(rows.scale, abs=1e-9)
    assert np.mean(np.abs(moved[rows.step == 1])) > 5.0 * np.mean(np.abs(moved[rows.step == 7]))
