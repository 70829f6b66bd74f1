"""The temperature around a cell by what the cell cools to."""

import numpy as np
import pytest
from bsa.core.reading.ambient import ambient_of, lowest_k, starts_warm

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
