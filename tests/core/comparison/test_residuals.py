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
