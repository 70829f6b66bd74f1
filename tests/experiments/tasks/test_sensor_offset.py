from dataclasses import replace

import numpy as np
import pytest
from bsa.core.record import Record
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.tasks.measured_cell import CellRequest
from bsa.experiments.tasks.record_request import RecordRequest
from bsa.experiments.tasks.records import build_task, holding_out

AMBIENT_K = 298.15


def record(first_k: float, name: str = "cell.csv", ambient_k: float | None = None) -> Record:
    """A discharge that warms the cell by 8 K, by a sensor that starts at a temperature."""
    time = np.arange(0.0, 1801.0, 10.0)
    kelvin = first_k + np.linspace(0.0, 8.0, len(time))
    steps = (Step(StepKind.CC_DISCHARGE, 0, len(time)),)
    return Record(
        name, Trajectory(time, np.full_like(time, 2.0), 4.0 - time / 6000.0, kelvin, steps), (), ambient_k or first_k
    )


def starts_k(offset_k: float, told: bool = True) -> tuple[list[float], list[str]]:
    """Temperatures at which a fitted and a held-out record start, and the notes that tell of a shift."""
    ambient_k = AMBIENT_K if told else None
    fitted = RecordRequest(record(AMBIENT_K + offset_k), temperature_k=ambient_k)
    later = RecordRequest(record(AMBIENT_K + offset_k, "later.csv"), temperature_k=ambient_k)
    task = holding_out(build_task("t", CellRequest("OKane2022", "SPM"), [fitted]), [later])
    found = [float(e.target.temperature[0]) for e in (*task.experiments, *task.held_out)]
    return found, [note for note in task.notes if "compared as a rise" in note]


def test_a_sensor_that_reads_more_than_the_ambient_temperature_is_compared_by_its_rise() -> None:
    found, notes = starts_k(0.6)
    assert found == pytest.approx([AMBIENT_K, AMBIENT_K])
    assert [note.split(":")[0] for note in notes] == ["cell.csv", "later.csv (held out)"]
    assert all("starts 0.6 K above the ambient one" in note for note in notes)


def test_a_cell_that_was_warm_stays_as_it_was_measured() -> None:
    assert starts_k(9.0) == (pytest.approx([AMBIENT_K + 9.0] * 2), [])


def cooling(first_k: float, name: str = "cell.csv", ambient_k: float | None = None) -> Record:
    """A rest in which the cell cools to the ambient temperature, or all but."""
    found = record(first_k, name, ambient_k)
    fallen = AMBIENT_K + (first_k - AMBIENT_K) * np.exp(-found.trajectory.time / 300.0)
    return replace(found, trajectory=found.trajectory.changed(temperature=fallen))


def test_a_cell_that_cools_was_warm_however_little() -> None:
    request = RecordRequest(cooling(AMBIENT_K + 2.0), temperature_k=AMBIENT_K)
    later = RecordRequest(cooling(AMBIENT_K + 2.0, "later.csv"), temperature_k=AMBIENT_K)
    task = holding_out(build_task("t", CellRequest("OKane2022", "SPM"), [request]), [later])
    for experiment in (*task.experiments, *task.held_out):
        assert (experiment.temperature_k, experiment.initial_temperature_k) == (AMBIENT_K, AMBIENT_K + 2.0)
        assert experiment.target.temperature is not None
        assert experiment.target.temperature[0] == AMBIENT_K + 2.0
    said = [note for note in task.notes if "starts 2.0 K above the ambient temperature" in note]
    assert [note.split(":")[0] for note in said] == ["cell.csv", "later.csv (held out)"]


def test_a_cell_that_is_further_off_than_sensors_starts_there_too() -> None:
    for off_k in (9.0, -9.0):
        request = RecordRequest(record(AMBIENT_K + off_k), temperature_k=AMBIENT_K)
        (experiment,) = build_task("t", CellRequest("OKane2022", "SPM"), [request]).experiments
        assert experiment.initial_temperature_k == AMBIENT_K + off_k
    near = RecordRequest(record(AMBIENT_K + 0.6), temperature_k=AMBIENT_K)
    assert build_task("t", CellRequest("OKane2022", "SPM"), [near]).experiments[0].initial_temperature_k is None


def test_without_a_given_temperature_nothing_is_shifted() -> None:
    assert starts_k(0.6, told=False) == (pytest.approx([AMBIENT_K + 0.6] * 2), [])


def test_a_file_that_has_its_ambient_temperature_is_shifted_too() -> None:
    request = RecordRequest(record(AMBIENT_K - 0.4, ambient_k=AMBIENT_K))
    (experiment,) = build_task("t", CellRequest("OKane2022", "SPM"), [request]).experiments
    assert experiment.target.temperature is not None
    assert experiment.target.temperature[0] == pytest.approx(AMBIENT_K)


def test_a_record_whose_protocol_is_simulated_keeps_its_temperature() -> None:
    request = RecordRequest(record(AMBIENT_K + 0.6), temperature_k=AMBIENT_K)
    by_protocol = replace(request, protocol=(("Discharge at 2 A for 30 minutes",),))
    (experiment,) = build_task("t", CellRequest("OKane2022", "SPM"), [by_protocol]).experiments
    assert experiment.target.temperature is not None
    assert experiment.target.temperature[0] == pytest.approx(AMBIENT_K + 0.6)
