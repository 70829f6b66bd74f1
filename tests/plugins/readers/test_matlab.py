"""MATLAB files: the layouts of three laboratories, and what is wrong with a file in one line."""

from __future__ import annotations

import struct
import sys
import zlib

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.core.record import ReadOptions
from bsa.core.trajectory import StepKind
from bsa.plugins.readers import matlab_files
from bsa.testing import ReaderConformance
from scipy.io import savemat

KINDS = [StepKind.REST, StepKind.CC_DISCHARGE, StepKind.REST]


def columns(time: str, voltage: str, current: str, amperes: float = 5.0, n: int = 200) -> dict:
    """Rest, discharge, rest of a 5 Ah cell, current positive on charge."""
    t = np.arange(n) * 10.0
    i = np.where((t >= 200) & (t < 10 * n - 400), -amperes, 0.0)
    v = 4.1 + 0.3 * np.cumsum(i) * 10 / 3600 + 0.03 * i
    return {time: t, voltage: v, current: i}


def panasonic() -> dict:
    meas = columns("Time", "Voltage", "Current")
    stamps = [f"3/11/2017 {8 + k // 360}:{k // 6 % 60:02d}:{k % 6 * 10:02d} AM" for k in range(200)]
    stamps = np.array(stamps, dtype=object)
    return {"meas": {**meas, "TimeStamp": stamps, "Battery_Temp_degC": 26.0 + 0 * meas["Time"],
                     "Chamber_Temp_degC": np.full(200, 25, dtype=np.uint8)}}  # fmt: skip


def rate_test() -> dict:
    test = {f"cRate_{rate}C": columns("timeVec", "volVec", "currVec", rate) for rate in (1, 2)}
    return {"RateTest": {"T0": test, "T25": test}}


def nasa() -> dict:
    data = {name: columns("Time", "Voltage_measured", "Current_measured", 1.0 + k) for k, name in enumerate("ab")}
    rows = [("charge", 24, data["a"]), ("discharge", 24, data["b"]), ("impedance", 24, {"Re": np.ones(48)})]
    types = [("type", "O"), ("ambient_temperature", "O"), ("data", "O")]
    return {"B0005": {"cycle": np.array(rows, dtype=types)}}


def saved(path, content, **how):
    savemat(path, content, **how)
    return path


def test_a_struct_of_columns(tmp_path):
    record = read_record(saved(tmp_path / "a.mat", panasonic()))
    assert [step.kind for step in record.trajectory.steps] == KINDS
    assert record.ambient_k == 298.15
    assert record.trajectory.temperature[0] == pytest.approx(299.15)
    assert '"Time", "Voltage", "Current" have no units; they were taken to be in s, V, A.' in record.notes


@pytest.mark.parametrize("more", [3, 5])
def test_columns_of_another_length_do_not_hide_the_record(tmp_path, more):
    for n in range(200, 208):
        others = {f"limit_{k}": np.arange(10.0) for k in range(more)}
        path = saved(tmp_path / "a.mat", {"meas": {**others, **columns("Time", "Voltage", "Current", n=n)}})
        assert len(read_record(path).trajectory) == n


def test_plain_variables_of_version_4(tmp_path):
    path = saved(tmp_path / "a.mat", columns("t", "U", "I"), format="4")
    assert [step.kind for step in read_record(path).trajectory.steps] == KINDS


@pytest.mark.parametrize("sheet", ["T25/cRate_2C", "RateTest/T25/cRate_2C", "T25/*2C"])
def test_one_of_several_tests(tmp_path, sheet):
    record = read_record(saved(tmp_path / "a.mat", rate_test()), ReadOptions(sheet=sheet))
    assert record.trajectory.current.max() == 2.0
    assert record.name == "a.mat: RateTest/T25/cRate_2C"


def test_the_test_that_a_message_offers_is_one(tmp_path):
    cell = {"RateTest": {name: {"Cell1": tests, "Cell2": tests} for name, tests in rate_test()["RateTest"].items()}}
    flat = {name: {c: {"data": columns("t", "U", "I")} for c in ("Cell1", "Cell2")} for name in ("T0", "T25")}
    for content, sheet in ((flat, "T25/*"), (flat, None), (cell, "T25/*")):
        path = saved(tmp_path / "a.mat", content)
        with pytest.raises(BsaError, match="holds") as found:
            read_record(path, ReadOptions(sheet=sheet))
        offered = found.value.hint.partition("--sheet ")[2].partition(", or say --join to join")[0]
        assert len(read_record(path, ReadOptions(sheet=offered)).trajectory) == 200


def test_letters_for_each_sample_are_no_field_to_choose_by(tmp_path):
    tests = {
        name: {**columns("t", "U", "I", n=n), "Status": "R" * n, "Operator": name}
        for name, n in (("one", 45), ("two", 50))
    }
    with pytest.raises(BsaError, match="holds 2 tests") as found:
        read_record(saved(tmp_path / "a.mat", tests))
    assert "--where Operator= one, two" in found.value.hint
    assert "Status" not in found.value.hint


def test_a_test_chosen_by_a_field_around_it(tmp_path):
    path = saved(tmp_path / "a.mat", nasa())
    record = read_record(path, ReadOptions(where={"type": "discharge"}))
    assert record.trajectory.current.max() == 2.0
    assert record.ambient_k == 297.15
    assert len(read_record(path, ReadOptions(sheet="1", where={"type": "charge"})).trajectory) == 200


def test_all_tests_that_fit_are_joined_when_asked_for(tmp_path):
    record = read_record(saved(tmp_path / "a.mat", rate_test()), ReadOptions(sheet="T25", join=True))
    assert len(record.trajectory) == 400
    assert record.trajectory.current.max() == 2.0
    assert any('"RateTest/T25/cRate_1C", "RateTest/T25/cRate_2C"' in note for note in record.notes)


def test_tests_are_joined_by_the_date_vectors_around_them(tmp_path):
    content = nasa()
    later = [(*row, np.array([2008.0, 4, 2 - k, 13, 8, 17.9])) for k, row in enumerate(content["B0005"]["cycle"])]
    types = [("type", "O"), ("ambient_temperature", "O"), ("data", "O"), ("time", "O")]
    path = saved(tmp_path / "a.mat", {"B0005": {"cycle": np.array(later, dtype=types)}})
    record = read_record(path, ReadOptions(join=True))
    assert record.trajectory.current[:200].max() == 2.0
    assert record.trajectory.current[200:].max() == 1.0
    assert record.trajectory.time[200] == pytest.approx(86400.0)
    assert any("joined by date" in note for note in record.notes)


@pytest.mark.parametrize("full", [1.0, 100.0])
def test_an_open_circuit_curve_is_a_very_slow_discharge(tmp_path, full):
    soc = np.linspace(0.0, full, 21)
    path = saved(tmp_path / "a.mat", {"ocv": {"refSoC": soc, "meanOCV": 3.0 + soc / full}})
    with pytest.raises(BsaError, match="holds an open-circuit curve") as raised:
        read_record(path)
    assert "--reader-option capacity=5" in raised.value.hint
    trajectory = read_record(path, reader_options={"capacity": 5.0}).trajectory
    assert trajectory.discharge_capacity[-1] == pytest.approx(5.0)
    np.testing.assert_allclose(trajectory.voltage, 4.0 - np.linspace(0, 1, 21))


@pytest.mark.parametrize(
    ("content", "options", "message", "hint"),
    [
        (
            rate_test(),
            {},
            "a.mat holds 4 tests.",
            "--sheet T0/cRate_1C, or say --join to join them; there are T0, T25 / cRate_1C, cRate_2C.",
        ),
        (rate_test(), {"sheet": "T25"}, "a.mat holds 2 tests that fit.", "cRate_1C, cRate_2C"),
        (rate_test(), {"sheet": "T25/x"}, 'no test for --sheet "T25/x"', "it has cRate_1C, cRate_2C."),
        (nasa(), {}, "a.mat holds 2 tests.", "--where type= charge, discharge"),
        (nasa(), {"where": {"type": "rest"}}, "no test for --where type=rest", "charge, discharge"),
        (nasa(), {"where": {"kind": "rest"}, "sheet": "1"}, '"kind" is not a column', '"Time"'),
        ({"ocv": {"x": np.arange(9.0), "v": np.ones(9)}}, {}, 'ocv has "x", "v"', "--column time=NAME"),
        ({"x": 3.0}, {}, "holds no columns of numbers", "struct of arrays"),
    ],
)
def test_what_cannot_be_chosen_is_said_with_what_there_is(tmp_path, content, options, message, hint):
    with pytest.raises(BsaError) as raised:
        read_record(saved(tmp_path / "a.mat", content), ReadOptions(**options))
    assert message in raised.value.message
    assert hint in raised.value.hint


def test_damaged_files(tmp_path):
    whole = saved(tmp_path / "a.mat", panasonic(), do_compression=True).read_bytes()
    path = tmp_path / "b.mat"
    for content in (b"", b"hello", whole[:200], whole[: len(whole) // 2], whole[:150] + b"\0" * 50 + whole[200:]):
        path.write_bytes(content)
        with pytest.raises(BsaError, match=r"b\.mat (is no MATLAB file|holds no columns)"):
            read_record(path)


def test_a_bomb_is_counted_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(matlab_files, "MAX_BYTES", 2**20)
    packed = zlib.compress(bytes(2**22))
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    path = tmp_path / "a.mat"
    path.write_bytes(header + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(BsaError, match="unpacks to more than 1 MiB"):
        read_record(path)


def hdf5(path, content) -> None:
    """What MATLAB writes with ``-v7.3``: structs as groups, struct arrays as references, numbers as rows."""
    h5py = pytest.importorskip("h5py", reason='pip install "battery-sim-agent[readers]"')

    def put(group, name, value):
        if isinstance(value, dict):
            child = group.create_group(name)
            child.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, inner in value.items():
                put(child, key, inner)
        elif isinstance(value, np.ndarray) and value.dtype.names:
            child = group.create_group(name)
            for key in value.dtype.names:
                places = []
                for k, inner in enumerate(value[key]):
                    put(group.file.require_group("#refs#"), f"{key}{k}", inner)
                    places.append(group.file[f"#refs#/{key}{k}"].ref)
                child.create_dataset(key, data=np.array(places, dtype=h5py.ref_dtype)[:, None])
        elif isinstance(value, str):
            item = group.create_dataset(name, data=np.array([[ord(c)] for c in value], dtype=np.uint16))
            item.attrs["MATLAB_class"] = np.bytes_("char")
        else:
            group.create_dataset(name, data=np.atleast_2d(np.asarray(value, dtype=float)))

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in content.items():
            put(file, name, value)
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def test_version_7_3(tmp_path):
    path = tmp_path / "a.mat"
    hdf5(path, rate_test())
    assert read_record(path, ReadOptions(sheet="T25/cRate_2C")).trajectory.current.max() == 2.0
    hdf5(path, nasa())
    record = read_record(path, ReadOptions(where={"type": "discharge"}))
    assert record.trajectory.current.max() == 2.0
    assert record.ambient_k == 297.15
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(BsaError, match="is no MATLAB file, or a damaged one"):
        read_record(path)


def test_version_7_3_without_h5py(tmp_path, monkeypatch):
    path = tmp_path / "a.mat"
    hdf5(path, nasa())
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(BsaError, match="needs h5py") as raised:
        read_record(path)
    assert raised.value.hint == 'pip install "battery-sim-agent[readers]"'


class TestMatlab(ReaderConformance):
    @pytest.fixture
    def name(self) -> str:
        return "matlab"

    @pytest.fixture
    def file(self, tmp_path):
        return saved(tmp_path / "cell.mat", panasonic())


def test_a_number_in_a_field_may_be_written_in_any_way(tmp_path):
    tests = [{**columns("t", "U", "I", n=n), "soc": float(soc)} for n, soc in ((45, 9), (50, 8.5))]
    path = saved(tmp_path / "a.mat", {"tests": tests})
    for wanted, count in (("9", 45), ("9.0", 45), ("8.5", 50)):
        assert len(read_record(path, ReadOptions(where={"soc": wanted})).trajectory) == count
