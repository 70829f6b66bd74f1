"""The lines fit a terminal, whatever the record."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.reading.summary import summary
from bsa.core.record import Record
from bsa.core.segmentation import segment
from bsa.core.spectrum import ImpedanceSpectrum
from bsa.core.trajectory import Trajectory
from bsa.experiments.data.words import duration, problem_lines, record_lines, spectrum_lines


def record(cycles: int = 1, interval: float = 30.0) -> Record:
    current = np.tile(np.repeat([0.0, 5.0, 0.0, -5.0], [10, 60, 20, 60]), cycles)
    time = np.arange(len(current)) * interval
    drawn = np.cumsum(current) * interval / 3600
    return Record("cell.csv", segment(Trajectory(time, current, 4.1 - 0.1 * drawn - 0.05 * current)), ("word " * 50,))


@pytest.mark.slow
@pytest.mark.parametrize("cycles", [1, 3, 400])
def test_a_record_fits_eighty_columns_and_a_page(cycles):
    lines = list(record_lines(summary(record(cycles))))
    assert max(map(len, lines)) <= 80
    assert len(lines) < 90
    text = "\n".join(lines)
    assert f"Steps ({4 * cycles})" in text
    assert ("more (--json has all)" in text) == (cycles == 400)
    assert "-5" in text
    assert "holds slower processes too" in text


def test_a_cell_of_a_few_milliampere_hours_is_told_in_as_many_digits():
    large = record(2).trajectory
    small = Record("coin.csv", segment(large.changed(current=large.current / 1000.0)))
    text = "\n".join(record_lines(summary(small)))
    assert "-0.002500" in text  # A.h of a discharge
    assert "0.002500        0.002500" in text  # A.h of a cycle
    assert "50833" not in text  # mohm
    assert "50830" in text
    assert max(map(len, text.splitlines())) <= 80


def test_a_slow_curve_is_told():
    assert any("Slow CC discharge" in line for line in record_lines(summary(record(interval=3600.0))))


def test_voltages_at_the_end_of_long_rests_are_told():
    current = np.concatenate([np.zeros(120), *[np.repeat([1.0, 0.0], [72, 120])] * 10])  # every ten seconds
    drawn = np.concatenate([[0.0], np.cumsum(current[1:])]) / 360.0
    pulses = segment(Trajectory(10.0 * np.arange(len(current)), current, 4.2 - 0.6 * drawn - 0.05 * current))
    lines = list(record_lines(summary(Record("pulses.csv", pulses))))
    first = lines.index("Voltage at the end of long rests (11), an open-circuit curve") + 2
    assert lines[first].split() == ["19.83", "min", "0.0000", "4.200"]
    assert [line.split()[-1] for line in lines[first : first + 11]] == [f"{4.2 - 0.12 * k:.3f}" for k in range(11)]


def test_a_spectrum():
    frequency = np.logspace(3, -1, 20)
    found = ImpedanceSpectrum("z.csv", frequency, 0.02 - 0.01j / frequency + 1e-5j * frequency, 3.7, 298.15)
    text = "\n".join(spectrum_lines(found))
    assert "20 points, 1000 to 0.1 Hz" in text
    assert "20.00 mohm, where the imaginary part is zero" in text
    assert "\n  at 1000 Hz      20.00" in text
    assert "Nothing was assumed" in text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (9.564e-06, "<0.1 ms"),
        (0.1, "0.1 s"),
        (119, "119 s"),
        (600, "10 min"),
        (36000, "10 h"),
        (8.64e6, "100 d"),
    ],
)
def test_lengths_of_time(seconds, text):
    assert duration(seconds) == text


def test_no_line_breaks_within_an_option():
    note = '"Zreal1" has no unit of impedance; it was taken to be in mohm (--reader-option unit=ohm or mohm).'
    assert any("--reader-option" in line for line in problem_lines([note]))
