"""Columns beside the signals: their units and their decimal commas count as those of the signals do."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.reading.reading import read_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions
from bsa.plugins.readers.assembly import read_table
from bsa.plugins.readers.table import find_table


def samples(header: str, *last: str, separator: str = ",") -> Samples:
    """A rest and a discharge at 1 A, with the last columns as they are written."""
    rows = (
        separator.join([f"{60 * k}", f"{4.2 - 0.01 * k:.4f}".replace(".", "," if separator == ";" else "."), *last])
        for k in range(20)
    )
    return read_table(find_table("\n".join([header, *rows]), "a"), ReadOptions(constant_current_a=-1.0))


def test_the_unit_of_a_counter_may_stand_beneath_its_name():
    found = samples("Time,Voltage,AhAccu\n[s],[V],[mAh]", "250").extra["net_ah"]
    np.testing.assert_allclose(found, 0.25)
    np.testing.assert_allclose(samples("Time [s],U [V],Ah [mAh]", "250").extra["net_ah"], 0.25)
    np.testing.assert_allclose(samples("Time,Voltage,AhAccu\n[s],[V],[Ah]", "250").extra["net_ah"], 250.0)


@pytest.mark.parametrize(("name", "charged_ah"), [("Charge_Capacity_Ah", 250.0), ("Charge_Capacity_mAh", 0.25)])
def test_the_unit_of_a_counter_may_end_its_name(name, charged_ah):
    np.testing.assert_allclose(samples(f"Time [s],U [V],{name}", "250").extra["charged_ah"], charged_ah)


@pytest.mark.parametrize("name", ["(Q-Qo)/C", "(Q-Qo) [A.s]", "Ah [C]"])
def test_a_counter_may_be_in_coulomb(name):
    np.testing.assert_allclose(samples(f"Time [s],U [V],{name}", "900").extra["net_ah"], 0.25)


def test_decimal_commas_of_counters_and_of_the_ambient_temperature_are_read():
    found = samples("Zeit[s];U[V];Ah[Ah];Ambient Temperature [°C]", "0,25", "24,5", separator=";").extra
    np.testing.assert_allclose(found["net_ah"], 0.25)
    np.testing.assert_allclose(found["ambient_k"], 297.65)


@pytest.mark.parametrize(
    ("header", "value"),
    [
        ("Time [s],U [V],Ambient Temperature [K]", "297.65"),
        ("Time [s],U [V],ChamberT", "24.5"),
        ("Time,Voltage,ChamberT\n[s],[V],[ChamberT]", "24.5"),
        ("Time,Voltage,Ambient Temperature\n[s],[V],[K]", "297.65"),
        ("Time [s],U [V],Chamber T [degF]", "76.1"),
    ],
)
def test_the_unit_of_the_ambient_temperature_counts(header, value):
    np.testing.assert_allclose(samples(header, value).extra["ambient_k"], 297.65)


def test_an_ambient_temperature_in_an_unknown_unit_is_not_used(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(
        "t [s],U [V],I [A],Chamber T [degR]\n" + "".join(f"{60 * k},{4 - 0.01 * k},-1,41\n" for k in range(50))
    )
    record = read_record(path)
    assert record.ambient_k is None
    assert any('"Chamber T [degR]" has the unit "degR"' in note for note in record.notes)
    said = read_record(path, ReadOptions(ambient_c=5.0))
    assert said.ambient_k == 278.15
    assert not any("degR" in note for note in said.notes)


@pytest.mark.parametrize("absent", ["", "NaN", "0"])
def test_spectra_between_the_steps_of_a_record_are_left_out(tmp_path, absent):
    path = tmp_path / "a.csv"
    rows = [f"{60 * k},{4 - 0.01 * k},-1,{absent},{absent},{absent}" for k in range(30)]
    rows[20:20] = [f"{1200 + k},-3.7865,0,{10.0**-k},0.03,{-0.01 * k}" for k in range(5)]
    path.write_text("\n".join(["Time_s,Voltage_V,Current_A,Frequency_Hz,Z_Real_Ohm,Z_Imag_Ohm", *rows]))
    record = read_record(path)
    assert record.trajectory.voltage.min() > 3.0
    assert any("5 rows of an impedance spectrum were left out" in note for note in record.notes)
