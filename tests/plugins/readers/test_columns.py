"""Names of columns: one with two meanings goes by its unit, and half a cell is no cell."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.core.record import ReadOptions, Signal
from bsa.plugins.readers.columns import resolve, signal_of
from bsa.plugins.readers.table import Table

SECONDS = np.arange(100) * 60.0
VOLTS = 4.2 - 0.01 * np.arange(100)


def written(path, header: str, *columns: np.ndarray):
    rows = (",".join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True))
    path.write_text("\n".join([header, *rows]))
    return path


@pytest.mark.parametrize(
    ("header", "scale"),
    [
        ("t/s,U/V,I/A,T/°C", 1.0),
        ("Run Time (h),Potential (V),Current (A),Temperature (°C)", 1 / 3600),
        ("~Time[h],U[V],I[A],T1[°C]", 1 / 3600),
        ("t,U,I,T\n[s],[V],[A],[degC]", 1.0),
        ("Seconds,Volts,Amps,Celsius", 1.0),
        ("Test Time#s,Voltage#V,Current#A,T#degC", 1.0),
        ("TestTime/Sec.,Voltage/V,Cur(A),AuxTemperature1/dC.", 1.0),
        ("timestamp_s,v_raw_V,i_raw_A,t_cell_degC", 1.0),
        ("Hours,Volts,Amps,degC", 1 / 3600),
        ("time/s,<Ewe/V>,<I>/A,T/degC", 1.0),
    ],
)
def test_short_names_go_by_their_units(tmp_path, header, scale):
    path = written(tmp_path / "a.csv", header, scale * SECONDS, VOLTS, np.full(100, -2.0), np.full(100, 25.0))
    found = read_record(path).trajectory
    np.testing.assert_allclose(found.time, SECONDS, atol=0.01)
    np.testing.assert_allclose(found.voltage, VOLTS)
    np.testing.assert_allclose(found.temperature, 298.15)


@pytest.mark.parametrize("unit", ["uA", "µA", "μA"])
def test_a_current_in_microamperes_is_read_as_such(tmp_path, unit):
    path = written(tmp_path / "a.csv", f"t/s,U/V,I({unit})", SECONDS, VOLTS, np.full(100, -2e3))
    np.testing.assert_allclose(read_record(path).trajectory.current, 2e-3)


def test_a_unit_stands_for_its_signal_where_no_column_has_a_name_of_it(tmp_path):
    columns = SECONDS, 1000.0 * VOLTS, np.full(100, -2.0), VOLTS
    path = written(tmp_path / "a.csv", "Seconds,Millivolts,Amps,Voltage", *columns)
    np.testing.assert_allclose(read_record(path).trajectory.voltage, VOLTS)
    path = written(tmp_path / "b.csv", "Seconds,Millivolts,Amps,Reference", *columns)
    np.testing.assert_allclose(read_record(path).trajectory.voltage, VOLTS)
    clock = written(tmp_path / "c.csv", "Hours,Seconds,Volts,Amps", SECONDS, SECONDS, VOLTS, np.full(100, -2.0))
    with pytest.raises(BsaError, match='2 columns for time: "Hours", "Seconds"'):
        read_record(clock)


@pytest.mark.parametrize("name", ["T [degF]", "Temp_F", "Temperature / °F", "Cell Temperature (Fahrenheit)"])
def test_temperatures_in_fahrenheit_are_read_as_such(tmp_path, name):
    columns = SECONDS, VOLTS, np.full(100, -2.0), np.full(100, 77.0)
    path = written(tmp_path / "a.csv", f"t/s,U/V,I/A,{name}", *columns)
    np.testing.assert_allclose(read_record(path).trajectory.temperature, 298.15)
    said = read_record(written(path, "t/s,U/V,I/A,Temperature", *columns), ReadOptions(units={"temperature": "degF"}))
    np.testing.assert_allclose(said.trajectory.temperature, 298.15)


@pytest.mark.parametrize(
    ("name", "signal"),
    [
        ("t", "time"),
        ("t/s", "time"),
        ("T [K]", "temperature"),
        ("T1", None),
        ("T1[s]", None),
        ("T1 / degC", "temperature"),
    ],
)
def test_a_short_name_is_a_temperature_with_its_unit_alone(name, signal):
    assert signal_of(name) == signal


def test_the_voltage_of_a_cell_with_a_reference_electrode_is_that_between_its_electrodes(tmp_path):
    header = "time/s,Ewe/V,Ece/V,Ewe-Ece/V,I/mA"
    columns = SECONDS, VOLTS + 0.1, np.full(100, 0.1), VOLTS, np.full(100, -2000.0)
    path = written(tmp_path / "a.csv", header, *columns)
    np.testing.assert_allclose(read_record(path).trajectory.voltage, VOLTS)
    path = written(path, header.replace("Ewe-Ece/V,", ""), *columns[:3], columns[4])
    with pytest.raises(
        BsaError, match=r'potentials of both electrodes \("Ewe/V", "Ece/V"\), but not the voltage'
    ) as found:
        read_record(path)
    assert "--column voltage=Ewe/V" in found.value.hint
    said = read_record(path, ReadOptions(columns={"voltage": "Ewe/V"})).trajectory.voltage
    np.testing.assert_allclose(said, VOLTS + 0.1)
    path = written(path, "time/s,Ewe/V,I/mA", *columns[:2], columns[4])
    np.testing.assert_allclose(read_record(path).trajectory.voltage, VOLTS + 0.1)


HEADER = ("time / s", "U [V]", "Current / A", "Temp")
UNITS = ("", "", "", "[degC]")


@pytest.mark.parametrize(
    ("signal", "said", "written"),
    [
        ("current", "mA", "A"),
        ("current", "Ampere", None),
        ("temperature", "K", "degC"),
        ("temperature", "celsius", None),
        ("time", "min", "s"),
    ],
)
def test_a_unit_that_a_person_says_in_place_of_the_file_s_is_kept_beside_it(
    signal: Signal, said: str, written: str | None
) -> None:
    table = Table("a.csv", HEADER, UNITS, lambda: iter(()), ",")
    found = resolve(table, ReadOptions.model_validate({"units": {signal: said}}))
    assert found[signal].unit == said.casefold()
    assert found[signal].written == written
    assert {column.written for name, column in found.items() if name != signal} == {None}


def test_an_amplitude_of_an_impedance_is_no_current_beside_the_current(tmp_path):
    columns = SECONDS, VOLTS, np.full(100, -2.0), np.full(100, 0.5)
    path = written(tmp_path / "a.csv", "time/s,Ecell/V,I/A,|I|/A", *columns)
    np.testing.assert_allclose(read_record(path).trajectory.current, 2.0)


@pytest.mark.parametrize(("name", "told"), [("Temp 13", True), ("AuxTemp", True), ("Template", False), ("Rate", False)])
def test_columns_that_may_be_the_temperature_are_named(tmp_path, name, told):
    path = written(tmp_path / "a.csv", f"t/s,U/V,I/A,{name}", SECONDS, VOLTS, np.full(100, -2.0), np.full(100, 25.0))
    found = read_record(path)
    assert found.trajectory.temperature is None
    assert any("may be (--column" in note and name in note for note in found.notes) == told


def test_a_row_of_units_may_hold_microamperes(tmp_path):
    path = written(tmp_path / "a.csv", "t,U,I\ns,V,µA", SECONDS, VOLTS, np.full(100, -2e3))
    np.testing.assert_allclose(read_record(path).trajectory.current, 2e-3)
