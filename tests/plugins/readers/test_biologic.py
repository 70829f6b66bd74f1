"""BioLogic files, binary and text: records and spectra."""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_file, read_record
from bsa.core.trajectory import StepKind
from bsa.testing import ReaderConformance

N = 120
TIME = 10.0 * np.arange(N)
AMPERES = np.where((TIME >= 200) & (TIME < 900), -1.5, 0.0)
VOLTS = 3.9 + 0.05 * AMPERES + 0.3 * np.cumsum(AMPERES) * 10 / 3600
FREQUENCY = np.logspace(4, -1, 26)
IMPEDANCE = 0.03 + 0.02 / (1 + 1j * FREQUENCY) + 1e-7j * FREQUENCY


def mpr(path: Path, columns: dict[int, tuple[str, np.ndarray]]) -> None:
    """One data module of version 0: the numbers of the columns with a zero byte before each, then the rows."""

    def module(name: bytes, data: bytes) -> bytes:
        header = name.ljust(10) + name.ljust(25) + struct.pack("<II", len(data), 0) + b"05/01/24"
        return b"MODULE" + header + data

    rows = np.empty(len(next(iter(columns.values()))[1]), dtype=[(str(k), kind) for k, (kind, _) in columns.items()])
    for number, (_, values) in columns.items():
        rows[str(number)] = values
    numbers = b"".join(bytes([0, number]) for number in columns)
    data = (struct.pack("<IB", len(rows), len(columns)) + numbers).ljust(1007, b"\0") + rows.tobytes()
    magic = b"BIO-LOGIC MODULAR FILE\x1a".ljust(48) + bytes(4)
    path.write_bytes(magic + module(b"VMP Set", b"\0") + module(b"VMP data", data))


def test_a_binary_record(tmp_path):
    path = tmp_path / "a.mpr"
    mpr(path, {4: ("<f8", TIME), 6: ("<f4", VOLTS), 8: ("<f4", 1000 * AMPERES)})
    record = read_record(path)
    kinds = [StepKind.REST, StepKind.CC_DISCHARGE, StepKind.REST]
    assert [step.kind for step in record.trajectory.steps] == kinds
    np.testing.assert_allclose(record.trajectory.voltage, VOLTS, rtol=1e-6)
    assert record.trajectory.current.max() == 1.5


GALVANOSTATIC, POTENTIOSTATIC, REST = 1, 2, 3


def of_cycling(path: Path, control: int | None = 5, charge: int | None = 13) -> np.ndarray:
    """A file as galvanostatic cycling writes it: a rest, 2 mA, a hold and a rest. Returns its current, mA."""
    mode = np.select([TIME < 200, TIME < 900, TIME < 1100], [REST, GALVANOSTATIC, POTENTIOSTATIC], REST)
    amount = np.select([mode == GALVANOSTATIC, mode == POTENTIOSTATIC], [2.0, 2.0 * np.exp(-(TIME - 890) / 100)], 0.0)
    since = np.append(0.0, amount[1:] * 10 / 3600)
    columns = {4: ("<f8", TIME), 6: ("<f4", np.full(N, 3.9)), 1: ("u1", mode)}
    columns |= {charge: ("<f8", np.cumsum(since) if charge == 13 else since)} if charge else {}
    columns |= {control: ("<f4", np.where(mode == GALVANOSTATIC, 2.0, 3.9))} if control else {}
    mpr(path, columns)
    return amount


@pytest.mark.parametrize("control", [5, 20, None])
@pytest.mark.parametrize("charge", [7, 13, 23])
def test_a_file_without_a_current_has_that_of_its_charge(tmp_path, control, charge):
    path = tmp_path / "a.mpr"
    amount = of_cycling(path, control, charge)
    record = read_record(path)
    measured = ~record.trajectory.inserted  # The net charge tells when the current was switched.
    np.testing.assert_allclose(-1e3 * record.trajectory.current[measured], amount, atol=1e-9)
    assert any("holds no current" in note for note in record.notes)


def test_a_current_that_is_set_begins_with_its_step(tmp_path):
    path = tmp_path / "a.mpr"
    time = np.repeat(TIME[::2], 2) + np.tile([0.0, 0.002], N // 2)  # the first sample of a step, 2 ms behind the last
    mode = np.where(time < 201, REST, GALVANOSTATIC)
    drawn = np.where(mode == GALVANOSTATIC, 2.0 * (time - 200.0) / 3600, 0.0)
    columns = {4: ("<f8", time), 6: ("<f4", np.full(N, 3.9)), 1: ("u1", mode), 13: ("<f8", drawn)}
    mpr(path, {**columns, 5: ("<f4", np.where(mode == GALVANOSTATIC, 2.0, 0.0))})
    found = read_record(path).trajectory
    current = found.current[~found.inserted]
    np.testing.assert_allclose(current[mode == GALVANOSTATIC], -2e-3)
    assert not current[mode == REST].any()


def test_a_rest_without_a_charge_has_no_current(tmp_path):
    path = tmp_path / "a.mpr"
    mpr(path, {4: ("<f8", TIME), 6: ("<f4", VOLTS), 1: ("u1", np.full(N, REST))})
    assert not read_record(path).trajectory.current.any()


def test_a_load_of_which_nothing_tells_the_current_is_refused(tmp_path):
    of_cycling(tmp_path / "a.mpr", charge=None)
    with pytest.raises(BsaError, match="no column for current"):
        read_record(tmp_path / "a.mpr")


def test_a_binary_spectrum(tmp_path):
    path = tmp_path / "a.mpr"
    parts = {32: ("<f4", FREQUENCY), 37: ("<f4", IMPEDANCE.real), 38: ("<f4", -IMPEDANCE.imag)}
    mpr(path, parts)
    spectrum = read_file(path)
    np.testing.assert_allclose(spectrum.impedance, IMPEDANCE, rtol=1e-5, atol=1e-8)


def test_a_record_with_a_spectrum_in_it_is_a_record(tmp_path):
    path = tmp_path / "a.mpr"
    frequency = np.zeros(N)
    frequency[60:86] = FREQUENCY
    parts = {32: ("<f4", frequency), 37: ("<f4", 0.03 * (frequency > 0)), 38: ("<f4", 0.01 * (frequency > 0))}
    mpr(path, {4: ("<f8", TIME), 6: ("<f4", VOLTS), 8: ("<f4", 1000 * AMPERES), **parts})
    record = read_record(path)
    assert any("26 rows of an impedance spectrum were left out" in note for note in record.notes)
    assert record.trajectory.duration == pytest.approx(TIME[-1])


def test_the_net_charge_tells_when_the_current_was_switched(tmp_path):
    path = tmp_path / "a.mpr"
    kept = (TIME < 200) | (TIME > 400)  # The load began at 200 s, and the next sample is 210 s later.
    charge = 1000 * np.cumsum(np.append(0.0, AMPERES[1:] * 10)) / 3600
    columns = {4: ("<f8", TIME), 6: ("<f4", VOLTS), 8: ("<f4", 1000 * AMPERES), 13: ("<f8", charge)}
    mpr(path, {number: (kind, values[kept]) for number, (kind, values) in columns.items()})
    drawn = read_record(path).trajectory.discharge_capacity[-1]
    assert drawn == pytest.approx(-1e-3 * charge[-1], rel=0.01)


@pytest.mark.parametrize("content", [b"", b"hello" * 50, b"BIO-LOGIC MODULAR FILE\x1a".ljust(48) + bytes(4)])
def test_damaged_files(tmp_path, content):
    path = tmp_path / "a.mpr"
    path.write_bytes(content)
    with pytest.raises(BsaError, match=r"a\.mpr is no BioLogic file"):
        read_record(path)


def test_without_the_library(tmp_path, monkeypatch):
    path = tmp_path / "a.mpr"
    path.write_bytes(b"x")
    monkeypatch.setitem(sys.modules, "galvani", None)
    with pytest.raises(BsaError, match="needs galvani") as raised:
        read_record(path)
    assert raised.value.hint == 'pip install "battery-sim-agent[biologic]"'


@pytest.mark.parametrize("comma", [False, True])
def test_a_text_export(tmp_path, comma):
    head = ["EC-Lab ASCII FILE", "Nb header lines : 7", "", "Galvanostatic Cycling", "Ns                  0     1", "µ"]
    lines = [*head, "mode\tox/red\tNs\ttime/s\tcontrol/V/mA\tEcell/V\t<I>/mA\tcycle number\t"]
    for t, v, i in zip(TIME, VOLTS, 1000 * AMPERES, strict=True):
        lines.append(f"1\t0\t{int(t >= 200) + int(t >= 900)}\t{t:.4f}\t0\t{v:.6f}\t{i:.3f}\t0\t")
    text = "\r\n".join(lines)
    path = tmp_path / "a.mpt"
    path.write_bytes((text.replace(".", ",") if comma else text).encode("latin-1"))
    record = read_record(path)
    kinds = [StepKind.REST, StepKind.CC_DISCHARGE, StepKind.REST]
    assert [step.kind for step in record.trajectory.steps] == kinds
    assert record.trajectory.current.max() == 1.5


def test_a_text_export_of_a_spectrum(tmp_path):
    lines = ["EC-Lab ASCII FILE", "Nb header lines : 3", "freq/Hz\tRe(Z)/Ohm\t-Im(Z)/Ohm\t|Z|/Ohm\ttime/s\t<Ewe>/V"]
    for f, z in zip(FREQUENCY, IMPEDANCE, strict=True):
        lines.append(f"{f:.6E}\t{z.real:.6E}\t{-z.imag:.6E}\t{abs(z):.6E}\t1.0\t3.7")
    path = tmp_path / "a.mpt"
    path.write_text("\n".join(lines))
    spectrum = read_file(path)
    np.testing.assert_allclose(spectrum.impedance, IMPEDANCE, rtol=1e-4, atol=1e-8)
    assert spectrum.voltage == 3.7


class TestBioLogic(ReaderConformance):
    @pytest.fixture
    def name(self) -> str:
        return "biologic-mpr"

    @pytest.fixture
    def file(self, tmp_path):
        mpr(tmp_path / "cell.mpr", {4: ("<f8", TIME), 6: ("<f4", VOLTS), 8: ("<f4", 1000 * AMPERES)})
        return tmp_path / "cell.mpr"


def test_a_text_file_with_a_header_line_for_each_of_many_loops(tmp_path):
    loops = [f"Loop {k} from point number {k} to {k + 1}" for k in range(300)]
    head = ["EC-Lab ASCII FILE", f"Nb header lines : {len(loops) + 4}", *loops, ""]
    rows = ("\t".join(map(repr, map(float, row))) for row in zip(TIME, VOLTS, 1000 * AMPERES, strict=True))
    path = tmp_path / "a.mpt"
    path.write_text("\n".join([*head, "time/s\tEwe/V\t<I>/mA", *rows]))
    np.testing.assert_allclose(read_record(path).trajectory.voltage, VOLTS)
