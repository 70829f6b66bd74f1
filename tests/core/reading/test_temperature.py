"""A column of temperatures with gaps, a faulty sensor, or another unit."""

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.samples import Samples
from bsa.core.reading.temperature import with_usable_temperature

CELSIUS = 273.15


def samples(temperature_c: np.ndarray, interval_s: float = 10.0) -> Samples:
    count = len(temperature_c)
    return Samples(
        "a.csv",
        interval_s * np.arange(count),
        np.full(count, 3.7),
        np.zeros(count),
        temperature_c + CELSIUS,
        names={"temperature": "T / degC"},
    )


def room(count: int = 200) -> np.ndarray:
    return 25.0 + 0.01 * np.arange(count)


@pytest.mark.parametrize("reading", [999.0, 3276.7, -200.0, -273.15])
def test_the_readings_of_a_faulty_sensor_are_interpolated(reading: float) -> None:
    broken = room()
    broken[50:61] = reading
    found = with_usable_temperature(samples(broken))
    assert found.temperature == pytest.approx(room() + CELSIUS)
    (note,) = found.notes
    assert note.startswith("11 temperatures that no cell has were interpolated (" + f"{reading:.5g} degC in rows 51")
    assert "rows 51, 52, 53, 54, 55 and 6 more" in note


def test_a_lone_jump_is_a_glitch_where_the_samples_are_near() -> None:
    jumped = room()
    jumped[80] = 70.0
    found = with_usable_temperature(samples(jumped))
    assert found.temperature == pytest.approx(room() + CELSIUS)
    assert found.notes == ("1 temperature that no cell has was interpolated (70 degC in row 81): is the sensor loose?",)
    # Where a cycler writes the ends of steps alone, a fast discharge warms and a rest cools between two samples.
    far = samples(jumped, interval_s=1800.0)
    assert with_usable_temperature(far) is far
    warming = room()
    warming[80:] += 40.0
    stays = samples(warming)
    assert with_usable_temperature(stays) is stays


def test_a_column_with_many_faulty_readings_is_not_used() -> None:
    broken = room()
    broken[20:60] = -200.0
    found = with_usable_temperature(samples(broken))
    assert found.temperature is None
    assert found.notes == (
        'column "T / degC" has no temperature of a cell (first -200 degC in row 21) in 40 of 200 rows; it is not used.',
    )


def test_gaps_are_interpolated_or_the_column_is_not_used() -> None:
    torn = room()
    torn[10] = np.nan
    found = with_usable_temperature(samples(torn))
    assert found.temperature == pytest.approx(room() + CELSIUS)
    assert found.notes == ("1 missing temperature was interpolated (row 11).",)
    for count in (30, 200):
        torn[:count] = np.nan
        dropped = with_usable_temperature(samples(torn))
        assert dropped.temperature is None
        assert dropped.notes == (f'column "T / degC" has no number in {count} of 200 rows; it is not used.',)


def test_an_open_sensor_is_no_reason_to_ask_for_a_unit() -> None:
    for reading in (-273.0, 999.0, 3276.7):
        found = with_usable_temperature(samples(np.full(50, reading)))
        assert found.temperature is None
        assert "no temperature of a cell in degC or in K (an open sensor reads so); it is not used" in found.notes[0]


@pytest.mark.parametrize(("reading", "unit"), [(298.15, "K"), (25.0 - CELSIUS, "degC")])
def test_the_other_unit_is_asked_for_where_it_gives_temperatures(reading: float, unit: str) -> None:
    with pytest.raises(BsaError, match=r'column "T / degC" shows .* which cannot be') as raised:
        with_usable_temperature(samples(np.full(50, reading)))
    assert raised.value.hint == f"is it in {unit}? Then say --unit temperature={unit}."
