"""Impedance spectra of three laboratories come out in ohm, negative where the cell is capacitive."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_file, read_record
from bsa.core.record import ReadOptions, Record
from bsa.core.spectrum import ImpedanceSpectrum

FREQUENCY = np.logspace(4, -2, 31)
OMEGA = 2 * np.pi * FREQUENCY
IMPEDANCE = 0.02 + 0.03 / (1 + 1j * OMEGA * 0.5) + 2e-7j * OMEGA
"""A lead, a resistance and one arc."""

DIGATRON = "\n".join(
    [
        "",
        "Measurement ID;3541",
        "Comment;25degC EIS",
        "",
        "Time Stamp;Step;Status;Voltage;Zreal1;Zimg1;ActFreq;ChamberT;",
        ";;;[V];[EIS];[EIS];[EIS];[ChamberT];",
        *(
            f"4/27/2017 8:52:{k:02d} AM;37;EIS;4.17;{1e3 * z.real:.7f};{1e3 * z.imag:.7f};{f:.7f};25.0;"
            for k, (f, z) in enumerate(zip(FREQUENCY, IMPEDANCE, strict=True))
        ),
        "4/27/2017 8:53:00 AM;38;STO;4.17;;;;25.0;",
    ]
)


GAMRY = "\n".join(
    [
        "EXPLAIN",
        "TAG\tEISPOT",
        *(f"SETTING{k}\tQUANT\t1.0\tOf many" for k in range(50)),
        "OCVCURVE\tTABLE\t90",
        "\tPt\tT\tVf\tVm\tAch",
        "\t#\ts\tV vs. Ref.\tV\tV",
        *(f"\t{k}\t{k}\t3.7\t3.7\t0" for k in range(90)),
        "EOC\tQUANT\t3.7\tOpen Circuit (V)",
        "ZCURVE\tTABLE",
        "\tPt\tTime\tFreq\tZreal\tZimag\tZsig\tZmod\tZphz\tIdc\tVdc\tIERange",
        "\t#\ts\tHz\tohm\tohm\tV\tohm\t°\tA\tV\t#",
        *(
            f"\t{k}\t{k}\t{f:.7g}\t{z.real:.7g}\t{z.imag:.7g}\t1\t{abs(z):.7g}\t-1.0\t0.001\t3.71\t8"
            for k, (f, z) in enumerate(zip(FREQUENCY, IMPEDANCE, strict=True))
        ),
    ]
)
"""A spectrum far below the settings and the open-circuit voltage before it."""


def table(header: str, sign: float = 1.0, unit: float = 1.0, separator: str = ",") -> str:
    rows = zip(FREQUENCY, unit * IMPEDANCE.real, sign * unit * IMPEDANCE.imag, strict=True)
    return "\n".join([header, *(separator.join(map(repr, map(float, row))) for row in rows)])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("digatron.csv", DIGATRON),
        ("gamry.DTA", GAMRY),
        ("biologic.txt", table("freq/Hz\tRe(Z)/Ohm\t-Im(Z)/Ohm", sign=-1.0, separator="\t")),
        ("ours.csv", table("Frequency [Hz],Zreal [mohm],Zimag [mohm]", unit=1e3)),
        ("primes.csv", table("Frequency (Hz),Z' (Ω),-Z'' (Ω)", sign=-1.0)),
        ("upwards.csv", table("Frequency [Hz],Zreal [ohm],Zimag [ohm]", sign=-1.0)),
    ],
)
def test_a_spectrum_is_in_ohm_and_capacitive_below(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    spectrum = read_file(path)
    np.testing.assert_allclose(spectrum.frequency, FREQUENCY, rtol=1e-4)
    np.testing.assert_allclose(spectrum.impedance, IMPEDANCE, rtol=1e-4, atol=1e-9)
    assert spectrum.ohmic_resistance == pytest.approx(0.02, rel=0.05)
    assert any("turned" in note for note in spectrum.notes) == (name == "upwards.csv")


def test_a_spectrum_of_gamry_s_has_the_voltage_at_which_it_was_measured_and_decimal_commas(tmp_path):
    path = tmp_path / "a.DTA"
    path.write_text(GAMRY, encoding="latin-1")
    assert read_file(path).voltage == pytest.approx(3.71)
    path.write_text(GAMRY.replace(".", ","))
    spectrum = read_file(path)
    assert spectrum.voltage == pytest.approx(3.71)
    np.testing.assert_allclose(spectrum.impedance, IMPEDANCE, rtol=1e-4, atol=1e-9)


def test_a_file_of_gamry_s_with_an_open_circuit_voltage_alone_is_no_spectrum(tmp_path):
    path = tmp_path / "a.DTA"
    path.write_text(GAMRY[: GAMRY.index("EOC")])
    with pytest.raises(BsaError, match="has no column for voltage, current"):
        read_file(path)


@pytest.mark.parametrize(
    ("header", "hertz", "ohm"),
    [
        ("Frequency [Hz],Zreal [kohm],Zimag [kohm]", 1.0, 1e-3),
        ("Frequency [kHz],Zreal [ohm],Zimag [ohm]", 1e-3, 1.0),
        ("freq/mHz,Re(Z)/mOhm,Im(Z)/mOhm", 1e3, 1e3),
        ("Frequency (MHz),Z' (Ω),Z'' (Ω)", 1e-6, 1.0),
    ],
)
def test_the_units_of_a_header_count(tmp_path, header, hertz, ohm):
    path = tmp_path / "a.csv"
    rows = zip(hertz * FREQUENCY, ohm * IMPEDANCE.real, ohm * IMPEDANCE.imag, strict=True)
    path.write_text("\n".join([header, *(",".join(map(repr, map(float, row))) for row in rows)]))
    spectrum = read_file(path)
    np.testing.assert_allclose(spectrum.frequency, FREQUENCY)
    np.testing.assert_allclose(spectrum.impedance, IMPEDANCE, atol=1e-12)
    assert not spectrum.notes


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("Frequency [Hz],Zreal [ohm cm2],Zimag [ohm cm2]", '"ohm cm2", which is no unit of impedance'),
        ("Frequency [rpm],Zreal [ohm],Zimag [ohm]", '"rpm", which is no unit of frequency'),
    ],
)
def test_a_unit_that_is_not_known_is_refused(tmp_path, header, message):
    path = tmp_path / "a.csv"
    path.write_text(table(header))
    with pytest.raises(BsaError, match=message):
        read_file(path)
    if "cm2" in header:
        spectrum = read_file(path, reader="impedance-csv", reader_options={"unit": "ohm"})
        np.testing.assert_allclose(spectrum.impedance, IMPEDANCE)


def test_several_spectra_of_a_file_are_told_apart(tmp_path):
    path = tmp_path / "a.csv"
    header, *rows = table("Frequency [Hz],Zreal [ohm],Zimag [ohm]").splitlines()
    path.write_text("\n".join([f"{header},cycle,SOC", *(f"{row},{n},{n / 2:g}" for n in (1, 2, 3) for row in rows)]))
    message = "more than one impedance spectrum: the frequency falls, but goes from 0.01 to 10000 Hz in row 33"
    with pytest.raises(BsaError, match=message) as found:
        read_file(path)
    assert found.value.hint == "choose one with --where cycle=1 or --where SOC=0.5 (here the first)."
    assert len(read_file(path, ReadOptions(where={"cycle": "2"}))) == len(FREQUENCY)
    path.write_text("\n".join([header, *rows, *rows[::-1]]))
    with pytest.raises(BsaError, match=r"goes from 0\.01 to 0\.01 Hz in row 33") as found:
        read_file(path)
    assert "cut the file there" in found.value.hint


def polar(header: str, sign: float = 1.0, unit: float = np.pi / 180.0) -> str:
    rows = zip(FREQUENCY, np.abs(IMPEDANCE), sign * np.angle(IMPEDANCE) / unit, strict=True)
    return "\n".join([header, *(",".join(map(repr, map(float, row))) for row in rows)])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (polar("Frequency / Hz,|Z| / Ohm,Phase / deg"), None),
        (polar("freq/Hz,|Z|/Ohm,Phase(Z)/deg"), None),
        (polar("Freq (Hz),Zmod (ohm),-Zphz (°)", sign=-1.0), None),
        (polar("f [Hz],abs(Z) [Ohm],phi [rad]", unit=1.0), None),
        (polar("f [Hz],|Z| [Ohm],phase"), '"phase" has no unit; it was taken to be in degrees.'),
        (polar("Frequency / Hz,|Z| / Ohm,Phase / deg", sign=-1.0), "it was taken to be -Im(Z) and turned"),
    ],
)
def test_a_magnitude_and_a_phase_are_a_spectrum(tmp_path, text, said):
    path = tmp_path / "bode.csv"
    path.write_text(text)
    spectrum = read_file(path)
    np.testing.assert_allclose(spectrum.impedance, IMPEDANCE, rtol=1e-9)
    assert [said in note for note in spectrum.notes] == ([True] if said else [])


@pytest.mark.parametrize("name", ["omega / rad/s", "omega [rad/s]", "ω (rad/s)", "Frequency [rad/s]", "omega"])
def test_an_angular_frequency_is_turned_into_hertz(tmp_path, name):
    rows = zip(OMEGA, IMPEDANCE.real, IMPEDANCE.imag, strict=True)
    path = tmp_path / "a.csv"
    path.write_text("\n".join([f"{name},Zreal [ohm],Zimag [ohm]", *(",".join(map(repr, map(float, r))) for r in rows)]))
    np.testing.assert_allclose(read_file(path).frequency, FREQUENCY)


def test_the_columns_of_a_spectrum_can_be_named(tmp_path):
    path = tmp_path / "own.csv"
    path.write_text(table("SetFreq [Hz],A [ohm],-B [ohm]", sign=-1.0))
    named = {"frequency": "SetFreq [Hz]", "real": "A [ohm]", "imaginary": "-B [ohm]"}
    np.testing.assert_allclose(read_file(path, ReadOptions(columns=named)).impedance, IMPEDANCE)
    with pytest.raises(BsaError, match=r'"SetFrq \[Hz\]" is not a column of own.csv'):
        read_file(path, ReadOptions(columns={**named, "frequency": "SetFrq [Hz]"}))
    with pytest.raises(BsaError, match="no columns for frequency with") as raised:
        read_file(path, ReadOptions(columns={"frequency": "SetFreq [Hz]"}))
    assert "--column real=NAME --column imaginary=NAME" in raised.value.hint
    # A name goes before what the header suggests, and columns that a record does not have are another file's.
    path.write_text(
        table("Frequency [Hz],Zreal [ohm],Zimag [ohm]").replace("\n", ",7\n").replace("],7", "],Z0 [ohm]", 1)
    )
    offset = read_file(path, ReadOptions(columns={"real": "Z0 [ohm]"})).impedance
    np.testing.assert_allclose(offset.real, 7.0)
    record = tmp_path / "record.csv"
    record.write_text("\n".join(["Time [s],U[V],I[A]", *(f"{k},{4 - 0.01 * k},-1" for k in range(50))]))
    assert len(read_record(record, ReadOptions(columns=named)).trajectory) == 50


def test_what_a_digatron_file_says_beside_the_impedance(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(DIGATRON)
    spectrum = read_file(path)
    assert spectrum.voltage == 4.17
    assert spectrum.temperature_k == 298.15
    assert "1 row without a frequency and an impedance was left out." in spectrum.notes
    assert read_file(path, ReadOptions(ambient_c=10.0)).temperature_k == 283.15
    assert abs(read_file(path, reader="impedance-csv", reader_options={"unit": "ohm"}).impedance[0]) > 10


def test_a_spectrum_is_no_record_and_a_record_no_spectrum(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(DIGATRON)
    with pytest.raises(BsaError, match=r"a\.csv is an impedance spectrum, not a record over time"):
        read_record(path)
    path.write_text("Time [s],U[V],I[A]\n" + "\n".join(f"{k},{4 - 0.01 * k},-1" for k in range(50)))
    with pytest.raises(BsaError, match="has no columns for frequency"):
        read_file(path, reader="impedance-csv")
    path.write_text(table("Frequency [Hz],Zreal [ohm],Zimag [ohm]")[:200])
    with pytest.raises(BsaError, match="points of impedance; at least 5"):
        read_file(path)


def test_points_come_in_order_of_frequency_and_are_finite_numbers():
    spectrum = ImpedanceSpectrum("a", FREQUENCY[::-1], IMPEDANCE[::-1])
    np.testing.assert_array_equal(spectrum.impedance, IMPEDANCE)
    assert ImpedanceSpectrum("a", FREQUENCY, IMPEDANCE.real).ohmic_resistance is None
    with pytest.raises(BsaError, match="no finite number"):
        ImpedanceSpectrum("a", -FREQUENCY, IMPEDANCE)
    with pytest.raises(BsaError, match="shape"):
        ImpedanceSpectrum("a", FREQUENCY[1:], IMPEDANCE)


@pytest.mark.real_data
@pytest.mark.parametrize(("number", "milliohm"), [(1, 21.0), (7, 21.5), (14, 22.9)])
def test_the_ohmic_resistance_of_a_measured_cell(number, milliohm):
    folder = Path(__file__).parents[3] / ".." / "shared" / "data" / "panasonic_18650pf" / "eis_25degC"
    if not folder.is_dir():
        pytest.skip("the measured cells of ../shared/data are not here")
    spectrum = read_file(folder / f"3541_EIS{number:05d}.csv")
    assert len(spectrum) == 54
    assert 1e3 * spectrum.ohmic_resistance == pytest.approx(milliohm, abs=1.0)
    assert spectrum.temperature_k == 298.15


@pytest.mark.parametrize(("unit", "volts"), [("mV", 3.7), ("V", 3700.0), ("kV", None)])
def test_a_rest_voltage_is_in_its_unit(tmp_path, unit, volts):
    rows = zip(FREQUENCY, IMPEDANCE.real, -IMPEDANCE.imag, strict=True)
    lines = (",".join(map(repr, map(float, row))) + ",3700" for row in rows)
    path = tmp_path / "eis.csv"
    path.write_text("\n".join([f"Frequency (Hz),Z' (Ohm),-Z'' (Ohm),Voltage ({unit})", *lines]))
    spectrum = read_file(path)
    assert isinstance(spectrum, ImpedanceSpectrum)
    assert spectrum.voltage == (None if volts is None else pytest.approx(volts))
    assert any("not known" in note for note in spectrum.notes) == (volts is None)


@pytest.mark.parametrize(("filled", "kind"), [(0.0, Record), (0.2, Record), (0.9, ImpedanceSpectrum)])
def test_a_record_with_columns_of_a_spectrum_is_one_where_most_rows_have_no_frequency(tmp_path, filled, kind):
    with_frequency = np.arange(len(FREQUENCY)) < filled * len(FREQUENCY)
    rows = [
        f"{60 * k},{4.1 - 0.01 * k},-500,{f if has else 0},{z.real if has else 0},{-z.imag if has else 0}"
        for k, (f, z, has) in enumerate(zip(FREQUENCY, IMPEDANCE, with_frequency, strict=True))
    ]
    path = tmp_path / "cell.txt"
    path.write_text("\n".join(["time/s,Ecell/V,I/mA,freq/Hz,Re(Z)/Ohm,-Im(Z)/Ohm", *rows]))
    assert isinstance(read_file(path), kind)


def test_a_spectrum_with_decimal_commas_and_the_columns_of_a_record_is_no_record(tmp_path):
    rows = (
        f"{60 * k}\t3,7\t0,25\t{f}\t{z.real}\t{-z.imag}".replace(".", ",")
        for k, (f, z) in enumerate(zip(FREQUENCY / 1e5, IMPEDANCE, strict=True))
    )
    path = tmp_path / "peis.txt"
    path.write_text("\n".join(["time/s\tEwe/V\tI/mA\tfreq/Hz\tRe(Z)/Ohm\t-Im(Z)/Ohm", *rows]))
    assert isinstance(read_file(path), ImpedanceSpectrum)


@pytest.mark.parametrize(
    ("name", "text", "encoding"),
    [
        ("quoted.csv", table('"Frequency (Hz)","Z\' (Ohm)","Z\'\' (Ohm)"'), "utf-8"),
        ("wide.csv", table("Frequency [Hz],Zreal [ohm],Zimag [ohm]"), "utf-16"),
        ("symbols.csv", table("f,Zre,Zim\nHz,Ω,Ω"), "utf-8"),
        ("ohm_sign.csv", table("f,Zre,Zim\nHz,m\u2126,m\u2126", unit=1e3), "utf-8"),
        ("spaces.txt", table("# freq re im", separator=" "), "utf-8"),
    ],
)
def test_names_in_quotation_marks_symbols_of_units_and_text_of_any_kind(tmp_path, name, text, encoding):
    (tmp_path / name).write_text(text, encoding=encoding)
    spectrum = read_file(tmp_path / name)
    np.testing.assert_allclose(spectrum.impedance, IMPEDANCE)


def test_both_parts_have_units_of_their_own(tmp_path):
    rows = zip(FREQUENCY, 1e3 * IMPEDANCE.real, IMPEDANCE.imag, strict=True)
    lines = (",".join(map(repr, map(float, row))) for row in rows)
    path = tmp_path / "eis.csv"
    path.write_text("\n".join(["Frequency [Hz],Zreal [mohm],Zimag [ohm]", *lines]))
    np.testing.assert_allclose(read_file(path).impedance, IMPEDANCE)
