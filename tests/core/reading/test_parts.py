"""Records that are silent while a charge may have passed."""

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.reading.parts import parts_between_gaps
from bsa.core.record import Record
from bsa.core.segmentation import segment
from bsa.core.trajectory import Trajectory


def record(*stretches: tuple[float, float, float]) -> Record:
    """A sample every 10 s of stretches, each begun at a time and as long as is said, at a current."""
    time = np.concatenate([start + np.arange(0.0, seconds, 10.0) for start, seconds, _ in stretches])
    current = np.concatenate([np.full(len(np.arange(0.0, s, 10.0)), amperes) for _, s, amperes in stretches])
    return Record("r.csv", segment(Trajectory(time, current, np.full(len(time), 3.7))), ("as read.",), 298.15)


def test_a_record_without_silence_or_silent_at_rest_is_one() -> None:
    whole = record(
        (0.0, 600.0, 0.0), (600.0, 1200.0, 1.0), (1800.0, 600.0, 0.0), (9000.0, 600.0, 0.0), (9600.0, 600.0, 1.0)
    )
    assert parts_between_gaps(whole) == [whole]


def test_a_silence_between_rests_in_which_charge_passed_parts_a_record() -> None:
    """A pulse test without the discharges between its sets: all of it had been simulated from one state of charge."""
    whole = record(
        (0.0, 600.0, 0.0), (600.0, 1200.0, 1.0), (1800.0, 600.0, 0.0), (9000.0, 600.0, 0.0), (9600.0, 600.0, 1.0)
    )
    first, second = parts_between_gaps(replace(whole, charged_gaps_s=(2390.0,)))
    assert second.trajectory.time[0] == 9000.0
    assert "or while charge passed" in first.notes[-1]


def test_parts_at_rest_are_records_and_those_under_load_are_left_out() -> None:
    whole = record(
        (0.0, 600.0, 0.0),
        (600.0, 1200.0, 1.0),
        # nobody wrote down when this discharge began
        (9000.0, 3600.0, 1.0),
        (12600.0, 600.0, 0.0),
        (13200.0, 600.0, 1.0),
        # nor when that one ended
        (20000.0, 600.0, 0.0),
        (20600.0, 600.0, 2.0),
    )
    first, second = parts_between_gaps(whole)
    assert (first.name, second.name) == ("r.csv, part 1", "r.csv, part 2")
    assert first.trajectory.duration == pytest.approx(1790.0)
    assert [float(second.trajectory.time[0]), second.trajectory.current[0]] == [20000.0, 0.0]
    assert [step.start for step in second.trajectory.steps] == [0, 60]
    assert first.notes[0] == "as read."
    assert "silences: 2" in first.notes[1]
    assert "state of charge: 2;" in first.notes[1]
    assert "1.33 h that begin under load or have less than 10 samples are left out" in first.notes[1]
    assert not second.notes


def test_a_part_of_a_few_samples_is_no_record() -> None:
    month_s = 30 * 86400.0
    storage = record((0.0, 3600.0, 1.0), (month_s, 10.0, 0.0), (2 * month_s, 3600.0, 1.0))
    (only,) = parts_between_gaps(storage)
    assert len(only.trajectory) == 360
    assert "less than 10 samples" in only.notes[1]


def test_a_first_part_of_a_few_samples_is_no_record_either() -> None:
    begun = record((0.0, 10.0, 1.0), (9000.0, 600.0, 0.0), (9600.0, 600.0, 1.0))
    (only,) = parts_between_gaps(begun)
    assert (only.name, only.trajectory.time[0], len(only.trajectory)) == ("r.csv", 9000.0, 120)
    assert "less than 10 samples are left out" in only.notes[1]
    loaded = record((0.0, 50.0, 1.0), (9000.0, 600.0, 1.0), (18000.0, 50.0, 1.0))
    (only,) = parts_between_gaps(loaded)
    assert (only.trajectory.time[0], len(only.trajectory)) == (9000.0, 60)
