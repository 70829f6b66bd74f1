"""The temperature around a cell by what was measured there, and by what the cell cools to."""

import numpy as np
import pytest
from bsa.core.reading.ambient import ambient_of, lowest_k, measured_ambient, starts_warm
from bsa.core.reading.checks import to_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions
from scipy.constants import zero_Celsius

ROOM_K = 298.15
HOUR = np.arange(0.0, 3601.0, 10.0)


def cooled(above_k: float, time=HOUR) -> np.ndarray:
    return ROOM_K + above_k * np.exp(-time / 600.0)


def test_a_warm_cell_tells_the_ambient_temperature_by_what_it_cools_to() -> None:
    kelvin, words = ambient_of(HOUR, cooled(8.0))
    assert kelvin == pytest.approx(ROOM_K, abs=0.05)
    assert "starts at 33.0 degC" in words
    assert "25.0 degC" in words
    # As few samples as a record may have.
    few = np.linspace(0.0, 3600.0, 10)
    assert ambient_of(few, cooled(8.0, few))[0] == pytest.approx(ROOM_K, abs=0.1)


def test_noise_drift_and_glitches_are_no_warm_cell() -> None:
    rng = np.random.default_rng(1)
    warming = ROOM_K + 8.0 * HOUR / 3600.0 + rng.normal(0.0, 0.3, len(HOUR))
    warming[0] = ROOM_K
    warming[-3:] = 284.6  # Panasonic's C/20 record ends so
    assert ambient_of(HOUR, warming) == (
        ROOM_K,
        "the ambient temperature is taken to be that of the first sample, 25.0 degC.",
    )
    assert not starts_warm(HOUR, cooled(0.7))


def test_the_coldest_of_many_days_is_not_that_of_the_others() -> None:
    time = np.arange(0.0, 10 * 86400.0, 600.0)
    room = ROOM_K + 0.2 * np.sin(time / 3e4)
    room[time > 9 * 86400.0] -= 6.0
    assert lowest_k(time, room) == pytest.approx(ROOM_K - 0.2, abs=0.1)


CURRENT = np.where(HOUR < 1200.0, 0.0, -2.0)


def test_the_chamber_counts_while_a_current_flows() -> None:
    chamber = np.where(HOUR < 900.0, ROOM_K, 263.15)
    assert measured_ambient(chamber, CURRENT) == (263.15, "")
    assert measured_ambient(chamber, 0.0 * CURRENT)[0] == 263.15
    chamber[200] = 1000.0  # a lone glitch
    assert measured_ambient(chamber, CURRENT) == (263.15, "")
    assert measured_ambient(np.full(len(HOUR), np.nan), CURRENT) == (None, "")
    kelvin, words = measured_ambient(np.where(HOUR < 3000.0, ROOM_K, 263.15), CURRENT)
    assert kelvin == ROOM_K
    assert "goes from -10.0 degC to 25.0 degC while a current flows; the median, 25.0 degC, is taken" in words


def cycled() -> Samples:
    """Three discharges from rest, the last one at -10 degC."""
    time = np.arange(3 * len(HOUR)) * 10.0
    current, cycle = np.tile(CURRENT, 3), np.repeat([1.0, 2.0, 3.0], len(HOUR))
    voltage = np.tile(4.1 - 0.2 * np.maximum(HOUR - 1200.0, 0.0) / 3600.0, 3)
    extra = {"cycle": cycle, "ambient_k": np.where(cycle < 3, ROOM_K, 263.15)}
    return Samples("a", time, voltage, current, extra=extra)


def test_cycles_that_are_chosen_have_their_own_ambient_temperature() -> None:
    assert to_record(cycled(), ReadOptions(cycles=(3, 3))).ambient_k == 263.15
    first = to_record(cycled(), ReadOptions(cycles=(1, 2)))
    assert first.ambient_k == ROOM_K
    assert not any("ambient" in note for note in first.notes)
    whole = to_record(cycled(), ReadOptions())
    assert whole.ambient_k == ROOM_K
    assert any("--cycles or --where choose a part" in note for note in whole.notes)
    said = to_record(cycled(), ReadOptions(ambient_c=5.0))
    assert said.ambient_k == 278.15
    assert not any("ambient" in note for note in said.notes)


def test_the_ambient_of_chosen_cycles_is_their_own() -> None:
    time = np.arange(0.0, 14400.0, 20.0)
    cycle = np.floor(time / 7200.0) + 1.0
    discharging = time % 7200.0 < 3600.0
    voltage = np.where(discharging, 4.1 - time % 7200.0 / 3600.0, 2.1 + time % 7200.0 / 3600.0)
    celsius = np.where(cycle == 1.0, 25.0, 45.0)
    samples = Samples(
        "a.csv", time, voltage, np.where(discharging, -1.0, 1.0), celsius + zero_Celsius, extra={"cycle": cycle}
    )
    for cycles, ambient_c in (((1, 1), 25.0), ((2, 2), 45.0)):
        assert to_record(samples, ReadOptions(cycles=cycles)).ambient_k == pytest.approx(ambient_c + zero_Celsius)
