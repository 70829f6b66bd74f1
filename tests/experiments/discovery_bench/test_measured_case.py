"""Blind cases of a measured cell."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.core.record import Record
from bsa.core.segmentation import segment
from bsa.core.trajectory import Trajectory
from bsa.experiments.cli.bench_discovery import discovery_app
from bsa.experiments.discovery_bench.blind_cell import options_of
from bsa.experiments.discovery_bench.grading import grade_of
from bsa.experiments.discovery_bench.making import make_cases, unseal
from bsa.experiments.discovery_bench.measured_case import hidden_in
from typer.testing import CliRunner

BASE = {"parameters": "Chen2020", "model": "SPMe", "search": "measured"}


def record(name: str, amperes: float) -> Record:
    time = np.arange(0.0, 1500.0, 5.0)
    current = np.where(time < 100.0, 0.0, amperes)
    voltage = 4.1 - 0.2 * np.cumsum(current) * 5.0 / 3600.0
    return Record(name, segment(Trajectory(time, current, voltage)), ambient_k=298.15)


def test_a_case_holds_the_records_with_what_is_hidden_and_says_nothing_of_it(tmp_path: Path) -> None:
    fitted, held = [record("slow", 1.0), record("fast", 3.0)], [record("other", 2.0)]
    cases = make_cases(tmp_path, hidden_in(fitted, held, BASE), 20, seed=3)
    answers = unseal(tmp_path)
    assert {answer["setting"] for answer in answers.values()} == {"single", "pair", "none", "outside"}
    for case in cases:
        answer, told = answers[case.name], json.loads((case / "case.json").read_text())
        assert not set(told) - {*BASE, "records", "held_out"}
        options = options_of(case, out=case)
        assert [len(options.data), len(options.holdout)] == [2, 1]
        assert (options.parameters, options.model, options.search) == tuple(BASE.values())
        read = [read_record(file.path).trajectory for file in (*options.data, *options.holdout)]
        same = [
            np.array_equal(one.voltage, was.trajectory.voltage) and np.array_equal(one.current, was.trajectory.current)
            for one, was in zip(read, [*fitted, *held], strict=True)
        ]
        assert all(same) if answer["setting"] == "none" else not any(same)


@pytest.mark.parametrize(
    ("verdict", "grade"), [("unexplained", "right"), ("no-missing-effect", "right"), ("effect-found", "wrong")]
)
def test_a_measured_cell_as_it_is_may_lack_something_without_a_name(verdict: str, grade: str) -> None:
    answer = {"names": [], "outside": "", "measured": True}
    assert grade_of({"verdict": verdict, "names": ["time-lag"] * (verdict == "effect-found")}, answer) == grade


def test_the_command_hides_effects_in_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, other = tmp_path / "cell.csv", tmp_path / "other.csv"
    one = record("cell", 2.0).trajectory
    rows = zip(one.time, -one.current, one.voltage, strict=True)
    file.write_text("\n".join(["Test Time / s,Current / A,Voltage / V", *(f"{t},{i},{v}" for t, i, v in rows)]))
    other.write_bytes(file.read_bytes())
    asked = ["hide", str(tmp_path / "blind"), "--data", str(file), str(other), "--parameters", "Chen2020"]
    done = CliRunner().invoke(discovery_app, [*asked, "--count", "2", "--seed", "4", "--temperature", "30"])
    assert done.exit_code == 0, done.output
    told = json.loads((tmp_path / "blind" / "case_002" / "case.json").read_text())
    assert told["records"] == [{"file": f"record_{n}.csv", "ambient_c": pytest.approx(30.0)} for n in (1, 2)]
    assert (told["parameters"], told["search"]) == ("Chen2020", "all")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "set.json").write_text("{}")
    done = CliRunner().invoke(discovery_app, ["hide", "other", *asked[2:-1], "set.json", "--count", "1"])
    assert done.exit_code == 0, done.output
    told = json.loads((tmp_path / "other" / "case_001" / "case.json").read_text())
    assert told["parameters"] == str(tmp_path / "set.json")
    missing = CliRunner().invoke(discovery_app, [*asked[:3], str(tmp_path / "none.csv"), *asked[5:]])
    assert isinstance(missing.exception, BsaError)
