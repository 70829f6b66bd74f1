"""How well the tests of a cell repeat."""

import csv

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.record import Record
from bsa.core.segmentation import segment
from bsa.core.trajectory import Trajectory
from bsa.experiments.cli.bench_discovery import discovery_app
from bsa.experiments.discovery_bench.repeats import repeats_table
from bsa.plugins.readers.bdf import write
from typer.testing import CliRunner


def discharge(extra_v):
    time = np.arange(0.0, 1500.0, 5.0)
    current = np.where(time < 100.0, 0.0, 2.5)
    voltage = 4.1 - 0.2 * np.cumsum(current) * 5.0 / 3600.0 - extra_v * (time >= 100.0)
    return Record("", segment(Trajectory(time, current, voltage)), ambient_k=298.15)


@pytest.mark.slow
def test_a_record_that_does_not_repeat_those_before_it_is_seen(tmp_path):
    files = [tmp_path / f"{name}.csv" for name in "abcd"]
    for file, extra_v in zip(files, (0.0, 0.0, 0.0, 0.1), strict=True):
        write(discharge(extra_v), file)
    out = tmp_path / "repeats.csv"
    asked = ["--parameters", "Chen2020", "--model", "SPM", "--temperature", "25", "--out", str(out)]
    found = CliRunner().invoke(discovery_app, ["repeats", "--data", *map(str, files), *asked])
    assert found.exit_code == 0, found.output
    with out.open() as lines:
        rows = {(row["record"], int(row["references"])): row for row in csv.DictReader(lines)}
    assert set(rows) == {("b", 1), ("c", 1), ("d", 1), ("c", 2), ("d", 2), ("d", 3)}
    same, other = rows["c", 2], rows["d", 2]
    assert float(same["left_mv"]) < 0.5 < 20.0 < float(other["left_mv"])
    assert float(same["ratio"]) < 0.1
    assert float(other["ratio"]) > 5.0 * float(same["ratio"])


def test_the_table_has_a_line_for_each_number_of_references():
    rows = [
        {"references": 1, "known_mv": 40.0, "left_mv": 2.0, "ratio": 0.5},
        {"references": 1, "known_mv": 42.0, "left_mv": 4.0, "ratio": 1.5},
        {"references": 2, "known_mv": 42.0, "left_mv": 3.0, "ratio": 0.7},
    ]
    lines = repeats_table(rows).splitlines()
    assert lines[2:] == [
        "| 1 | 2 | 41.0 | 3.0 | 1.00 | 1.40 | 1.50 |",
        "| 2 | 1 | 42.0 | 3.0 | 0.70 | 0.70 | 0.70 |",
    ]


def test_one_record_repeats_nothing(tmp_path):
    write(discharge(0.0), tmp_path / "a.csv")
    found = CliRunner().invoke(
        discovery_app, ["repeats", "--data", str(tmp_path / "a.csv"), "--parameters", "Chen2020"]
    )
    assert isinstance(found.exception, BsaError)
    assert "one record repeats nothing" in str(found.exception)
