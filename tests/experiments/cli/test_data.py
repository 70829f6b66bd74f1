"""``bsa data``: words, JSON, a picture and an export of the same files, and one line for what cannot be done."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.experiments.cli.main import app
from typer.testing import CliRunner

ROWS = [
    (10.0 * k, 4.1 - 0.001 * k - (0.1 if 20 <= k < 180 else 0.0), -5.0 if 20 <= k < 180 else 0.0) for k in range(200)
]
RECORD = "Time [s],U[V],I[A]\n" + "\n".join(",".join(map(repr, row)) for row in ROWS)
SPECTRUM = "Frequency [Hz],Zreal [ohm],Zimag [ohm]\n" + "\n".join(
    f"{f},{0.02 + 0.01 / f},{1e-5 * f - 0.01 / f}" for f in np.logspace(3, -1, 20)
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text(RECORD)
    (tmp_path / "b_2020-01-02.csv").write_text(RECORD)
    (tmp_path / "z.csv").write_text(SPECTRUM)
    return tmp_path


def said(*arguments: str) -> str:
    result = CliRunner().invoke(app(), ["data", *arguments])
    if result.exception is not None:
        raise result.exception
    return result.stdout


def test_a_record_and_a_spectrum_in_words():
    text = said("a.csv", "z.csv")
    assert "200 samples over 33.17 min, one in 10 s" in text
    assert "CC discharge" in text
    assert "impedance spectrum, 20 points" in text


def test_the_same_as_json():
    found = json.loads(said("a.csv", "--json"))
    assert found["kind"] == "record"
    assert [step["kind"] for step in found["steps"]] == ["rest", "CC discharge", "rest"]
    assert found["current"] == [-5.0, 0.0]
    assert found["steps"][1]["current_a"] == -5.0
    assert found["steps"][1]["charge_ah"] < 0.0
    assert found["resistances"][0]["current_change_a"] == -5.0
    assert found["resistances"][0]["ohm"] == pytest.approx(0.02, rel=0.02)
    both = json.loads(said("a.csv", "z.csv", "--json"))
    assert [one["kind"] for one in both] == ["record", "impedance spectrum"]


def test_a_record_is_shown_as_the_parts_that_a_calibration_uses(folder):
    rows = [*ROWS[:100], *((3e5 + time, *others) for time, *others in ROWS)]
    (folder / "gap.csv").write_text("Time [s],U[V],I[A]\n" + "\n".join(",".join(map(repr, row)) for row in rows))
    parts = json.loads(said("gap.csv", "--json"))
    assert [part["samples"] for part in parts] == [100, 200]
    assert [part["whole"]["samples"] for part in parts] == [300, 300]
    text = said("gap.csv")
    assert "silent for long beside a load" in text
    assert text.startswith(
        "gap.csv: 300 of 300 samples (49.67 min of 83.89 h, 1 of 1 cycle) are listed, in\n2 parts, as"
    )


def test_the_first_line_says_that_a_part_is_left_out(folder):
    rows = [*ROWS[:100], *((3e5 + time, *others) for time, *others in ROWS[100:])]
    (folder / "gap.csv").write_text("Time [s],U[V],I[A]\n" + "\n".join(",".join(map(repr, row)) for row in rows))
    assert said("gap.csv").startswith("gap.csv: 100 of 200 samples (16.5 min of 83.89 h, 1 of 1 cycle) are listed")
    found = json.loads(said("gap.csv", "--json"))
    assert (found["samples"], found["whole"]["samples"]) == (100, 200)
    said("gap.csv", "--plot", "gap.svg")
    assert "all of the record; 100 of 200 samples" in (folder / "gap.svg").read_text()
    assert said("a.csv").startswith("a.csv\n")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a.csv", "z.csv"])
@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_a_picture(folder, name, suffix):
    assert f"written: out.{suffix}" in said(name, "--plot", f"out.{suffix}")
    start = (folder / f"out.{suffix}").read_bytes()[:60]
    assert start.startswith(b"\x89PNG" if suffix == "png" else b"<?xml")


@pytest.mark.parametrize("out", ["out.csv", "out.parquet"])
def test_an_export_is_read_back_as_it_was(out):
    pytest.importorskip("pyarrow", reason='pip install "battery-sim-agent[readers]"')
    said("a.csv", "--export", "bdf", "--out", out)
    one, two = read_record("a.csv").trajectory, read_record(out).trajectory
    assert one.steps == two.steps
    for signal in one.signals:
        np.testing.assert_array_equal(one.values(signal), two.values(signal))


def test_files_of_one_cell_are_joined():
    found = json.loads(said("a.csv", "b_2020-01-02.csv", "--join", "--json"))
    assert found["name"] == "a.csv and 1 more"
    assert found["samples"] == 400
    assert any("2 parts were joined" in problem for problem in found["problems"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nope.csv"], "there is no file nope.csv"),
        (["a.csv", "--export", "csv", "--out", "x.csv"], 'no export "csv"'),
        (["a.csv", "--export", "bdf"], "--export and --out belong together"),
        (["a.csv", "--out", "x.csv"], "--export and --out belong together"),
        (["a.csv", "z.csv", "--plot", "x.png"], "2 files were given"),
        (["a.csv", "--plot", "x.pdf"], "x.pdf is not the name of a picture"),
        (["a.csv", "--export", "bdf", "--out", "x.txt"], "x.txt is not the name of a record in the Battery Data"),
        (["z.csv", "--export", "bdf", "--out", "x.csv"], "holds records over time"),
        (["a.csv", "z.csv", "--join"], "1 of 2 files to be joined are impedance spectra"),
    ],
)
def test_what_cannot_be_done(folder, arguments, message):
    before = sorted(folder.iterdir())
    with pytest.raises(BsaError, match=message) as raised:
        said(*arguments)
    assert raised.value.hint
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("read", ["a.csv", "./a.csv", "a.csv#1", "link.csv"])
def test_a_file_that_is_read_is_never_written(folder, read):
    (folder / "link.csv").symlink_to(folder / "a.csv")
    with pytest.raises(BsaError, match=r"--out .*a\.csv is a file that is read; nothing was written"):
        said(read, "--export", "bdf", "--out", str(folder / "a.csv"))
    assert (folder / "a.csv").read_text() == RECORD


@pytest.mark.parametrize("arguments", [["--export", "bdf", "--out", "cell/new.csv"], ["--plot", "cell/new.png"]])
def test_nothing_is_written_into_a_folder_that_is_read(folder, arguments):
    (folder / "cell").mkdir()
    (folder / "cell" / "a.csv").write_text(RECORD)
    with pytest.raises(BsaError, match=r"lies in the folder cell, whose files are read"):
        said("cell", *arguments)
    assert [file.name for file in (folder / "cell").iterdir()] == ["a.csv"]


@pytest.mark.slow
def test_an_earlier_export_is_replaced_and_another_file_is_not(folder):
    said("a.csv", "--export", "bdf", "--out", "out.csv", "--plot", "out.png")
    (folder / "out.csv").write_text("Test Time / s,older")
    said("a.csv", "--export", "bdf", "--out", "out.csv", "--plot", "out.png")
    assert "older" not in (folder / "out.csv").read_text()
    with pytest.raises(BsaError, match=r"b_2020-01-02\.csv holds something that is not a record in the"):
        said("a.csv", "--export", "bdf", "--out", "b_2020-01-02.csv")
    (folder / "notes.png").write_text("my notes")
    with pytest.raises(BsaError, match=r"notes\.png holds something that is not a picture"):
        said("a.csv", "--plot", "notes.png")
