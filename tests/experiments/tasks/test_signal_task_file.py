"""A task of any simulator, written as YAML or JSON."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from bsa.core.encoding import encode_task
from bsa.core.errors import BsaError
from bsa.experiments.cli.main import run_main
from bsa.experiments.tasks.find import find_task
from bsa_oscillator import DISPLACEMENT, HIDDEN, OSCILLATOR, oscillator_task, record
from bsa_toy_cell import toy_task

TASK = """
name: bench
simulator: oscillator
model: linear
parameters:
  - {name: Mass, unit: kg, initial: 1.0, bounds: [0.3, 4.0], scale: log}
  - {name: "Stiffness [N.m-1]", initial: 85.0, bounds: [20, 400], scale: log}
  - {name: "Damping [N.s.m-1]", initial: 1.5, bounds: [0.05, 10], scale: log}
records:
  - data: bench.csv
    columns: {time: t, force: F}
    steps:
      - {kind: pull, until: 2}
      - {kind: free decay, until: 6}
      - {kind: sweep, until: 14}
"""

OWN_SIGNALS = """
signals:
  - {name: force, unit: N, role: driven}
  - {name: displacement, unit: m, tolerance: 1.0e-3, shown_unit: mm, shown_scale: 1000, oscillates: true}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    made = record(3)
    columns = [made.time, *(made.values(name) for name in ("force", "displacement", "velocity"))]
    lines = [",".join(f"{value:.8g}" for value in row) for row in zip(*columns, strict=True)]
    (tmp_path / "bench.csv").write_text("\n".join(["t,F,displacement,velocity", *lines]) + "\n")
    (tmp_path / "bench.yaml").write_text(TASK)
    return tmp_path


def said(text: str, name: str = "wrong.yaml") -> str:
    Path(name).write_text(text)
    with pytest.raises(BsaError) as caught:
        find_task(name)
    return str(caught.value)


def test_a_yaml_file_gives_the_simulators_own_domain_and_signals() -> None:
    task = find_task("bench.yaml")
    assert task.domain is OSCILLATOR
    assert task.signals == OSCILLATOR.signals
    assert task.simulator == "oscillator"
    assert task.space.names == tuple(HIDDEN)
    assert task.space["Mass [kg]"].unit == "kg"
    (experiment,) = task.experiments
    assert [(step.kind, step.start, step.stop) for step in experiment.target.steps] == [
        ("pull", 0, 201),
        ("free decay", 201, 601),
        ("sweep", 601, 1401),
    ]
    np.testing.assert_allclose(experiment.target.values("displacement"), record(3).values("displacement"), atol=1e-8)


def test_the_documentations_example_is_a_task_file() -> None:
    page = (Path(__file__).parents[3] / "docs" / "signals.md").read_text()
    (example,) = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    Path("bench-3.csv").write_text(Path("bench.csv").read_text().replace("t,F,", "t_s,force,"))
    Path("bench-3.yaml").write_text(example)
    task = find_task("bench-3.yaml")
    assert task.name == "bench-3"
    assert task.space.names == tuple(HIDDEN)


def test_a_json_file_says_the_same_with_its_values_inline(folder: Path) -> None:
    content = yaml.safe_load(TASK + OWN_SIGNALS)
    made = record(3)
    values = {name: made.values(name).tolist() for name in ("force", "displacement")} | {"time": made.time.tolist()}
    content["records"] = [{"name": "inline", "values": values}]
    Path("bench.json").write_text(json.dumps(content))
    task = find_task("bench.json")
    assert [signal.name for signal in task.signals] == ["force", "displacement"]
    assert task.observed[0].tolerance == 5 * DISPLACEMENT.tolerance
    assert len(task.experiments[0].target.steps) == 1
    np.testing.assert_array_equal(task.experiments[0].target.values("force"), made.values("force"))


def test_a_json_file_may_hold_an_encoded_task(folder: Path) -> None:
    for task in (toy_task(), oscillator_task()):
        Path("task.json").write_text(json.dumps(encode_task(task)))
        assert encode_task(find_task("task.json")) == encode_task(task)


@pytest.mark.slow
def test_a_task_file_is_calibrated_by_the_command(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["bsa-run", "bench.yaml", "--out", "run", "--workers", "1", "--no-identifiability"]
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as ended:
        run_main()
    assert ended.value.code == 0
    best = json.loads((folder / "run" / "best_parameters.json").read_text())
    assert best == pytest.approx(HIDDEN, rel=0.005)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("simulator: oscillator", "simulator: oscilator", 'there is no simulator "oscilator"'),
        ("model: linear", "modle: linear", '"modle" is not a known key'),
        ('scale: log}\n  - {name: "Sti', 'scale: cubic}\n  - {name: "Sti', "\"parameters.0.scale\" is 'cubic'"),
        ("bounds: [0.3, 4.0]", "bounds: [4.0, 0.3]", "lower < upper must hold"),
        ("bounds: [0.3, 4.0]", "bounds: [0.3]", '"parameters.0.bounds'),
        ("name: Mass, unit: kg, initial: 1.0", "name: Mass, unit: kg", '"parameters.0.initial" is missing'),
        ("columns: {time: t, force: F}", "columns: {time: t, force: f}", 'bench.csv has no column "f" for force'),
        ("columns: {time: t, force: F}", "columns: {time: t, pull: F}", '"pull" is neither time nor a signal'),
        ("until: 6", "until: 1", 'the step "free decay" until 1 s holds no sample'),
        ("data: bench.csv", "data: nowhere.csv", "there is no file nowhere.csv"),
        ("    columns: {time: t, force: F}", "    values: {time: [0, 1]}", "give either data or values"),
        ("    data: bench.csv", "    dta: bench.csv", '"records.0.dta" is not a known key'),
        ("name: bench\n", "", '"name" is missing'),
    ],
)
def test_what_is_wrong_is_told_with_its_key(before: str, after: str, message: str) -> None:
    text = TASK.replace("  - data: bench.csv", "  -\n    data: bench.csv")
    assert before in text
    told = said(text.replace(before, after))
    assert message in told
    assert "wrong.yaml" in told


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("tolerance: 1.0e-3, ", "", "an observed signal needs a tolerance"),
        ("tolerance: 1.0e-3", "tolerance: -1", '"signals.1.tolerance" is -1'),
        ("role: driven", "role: drives", "\"signals.0.role\" is 'drives'"),
        ("name: displacement", "name: Displacement", 'named "Displacement"'),
        ("unit: m,", "units: m,", '"signals.1.units" is not a known key'),
        ("name: force", "name: displacement", '2 signals are named "displacement"'),
    ],
)
def test_what_is_wrong_with_a_signal_is_told(before: str, after: str, message: str) -> None:
    assert before in OWN_SIGNALS
    assert message in said(TASK + OWN_SIGNALS.replace(before, after))


def test_a_file_that_is_no_json_is_told_apart() -> None:
    assert "is not valid JSON" in said("{", "wrong.json")
    assert "does not read as an encoded task" in said('{"space": [], "simulator": "x"}', "wrong.json")
    assert '"name" is missing' in said("{}", "wrong.json")


def test_two_records_of_one_name_are_refused() -> None:
    again = TASK + "\n  - data: bench.csv\n    columns: {time: t, force: F}\n    steps: [{kind: all, until: 14}]\n"
    assert '2 records are named "bench.csv". Hint: give each a name of its own' in said(again)
