"""The examples of docs/plugins.md run as they stand there: a stranger's plugins, from the page alone."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bsa.core.contracts.effect_choice import effects_of
from bsa.core.contracts.kinds import KINDS
from bsa.core.contracts.registry import installed
from bsa.core.reading.reading import read_record
from bsa.core.record import ReadOptions
from bsa.core.run.journal import read_events
from bsa.experiments.cli.catalogue import doctor
from bsa.experiments.cli.main import run_main

PAGE = (Path(__file__).parents[2] / "docs" / "plugins.md").read_text()
BLOCKS = {kind: re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL) for kind in ("python", "yaml", "sh")}
EXAMPLES = [block for block in BLOCKS["python"] if "@hookimpl\ndef bsa_" in block]

ANSWER = f"""#!{sys.executable}
import json, sys
name = next(iter(json.load(sys.stdin)["schema"]["properties"]["updated_params"]["properties"]))
words = dict.fromkeys(["analysis", "hypothesis", "rationale"], "none")
print(json.dumps({{**words, "updated_params": {{name: "*1.02"}}}}))
"""
"""A program as the route of the page asks it."""

Install = Callable[..., Path]


@pytest.fixture(autouse=True)
def _installed(stranger: Install, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number, code in enumerate(EXAMPLES):
        stranger(code, f"zz-example-{number}")
    monkeypatch.chdir(tmp_path)
    for name, content in zip(("mine.yaml", "bsa-presets.yaml"), BLOCKS["yaml"], strict=True):
        (tmp_path / name).write_text(content)


def ran(monkeypatch: pytest.MonkeyPatch, command: str, *more: str) -> None:
    (words,) = [line.split()[1:] for block in BLOCKS["sh"] for line in block.splitlines() if line.startswith(command)]
    monkeypatch.setattr(sys, "argv", ["bsa-run", *words, *more, "--no-identifiability"])
    with pytest.raises(SystemExit) as caught:
        run_main()
    assert caught.value.code == 0


def test_there_is_one_of_each_kind_and_all_can_be_used() -> None:
    strangers = {listing.kind for listing in installed().listings() if listing.origin.startswith("zz-example")}
    assert strangers == set(KINDS)
    assert installed().unusable == []


@pytest.mark.slow
def test_a_run_of_five_kinds(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ran(monkeypatch, "bsa-run demo --scaffold mine.yaml", "--rounds", "3", "--out", "run")
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert result["simulations"] == 1 + 4 + 3
    assert result["best"]["mape"] is not None
    trials = [event for event in read_events(tmp_path / "run") if event["event"] == "trial"]
    assert {trial["feedback"]["verdict"] for trial in trials} == {"far"}


@pytest.mark.slow
def test_a_run_with_the_backend(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    more = ["--rounds", "2", "--warmup", "0", "--set", "simulator.use=ohmic", "--out", "run"]
    ran(monkeypatch, "bsa-run demo --scaffold full --backend echo", *more)
    replies = [event for event in read_events(tmp_path / "run") if event["event"] == "reply"]
    assert [reply["model"] for reply in replies] == ["echo large"] * 2
    assert '"*1.02"' in replies[0]["text"]


@pytest.mark.slow
def test_a_run_by_the_route(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    doctor()
    assert "my-model program: not ready chmod +x ./answer" in " ".join(capsys.readouterr().out.split())
    answer = tmp_path / "answer"
    answer.write_text(ANSWER)
    answer.chmod(0o755)
    more = ["--rounds", "2", "--warmup", "0", "--set", "simulator.use=ohmic", "--out", "run"]
    ran(monkeypatch, "bsa-run demo --scaffold full --backend my-model", *more)
    events = read_events(tmp_path / "run")
    assert [event["model"] for event in events if event["event"] == "reply"] == ["./answer"] * 2
    assert json.loads((tmp_path / "run" / "result.json").read_text())["backend"] == "my-model via program"


def test_the_reader(tmp_path: Path) -> None:
    time, current = np.arange(60), np.repeat([0.0, -1.0, 0.0], 20)
    np.savetxt(tmp_path / "cell.ticks", np.column_stack([time, 4.0 + np.cumsum(current) * 0.02, current]))
    record = read_record(tmp_path / "cell.ticks", ReadOptions(ambient_c=20.0), reader_options={"tick_s": 10})
    assert record.trajectory.duration == 590.0
    assert record.trajectory.current.max() == 1.0
    assert record.ambient_k == pytest.approx(293.15)


def test_the_effect() -> None:
    (effect,) = effects_of(["meter-drift"], options={"largest_v": 0.01})
    assert effect.strength.upper == 0.01


def test_the_task_names_its_simulator(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ran(monkeypatch, "bsa-run pulse", "--out", "run")
    best = json.loads((tmp_path / "run" / "best_parameters.json").read_text())
    # The ohmic cell takes 0.05 Ohm times what the first parameter is of its initial value; the record has 0.08 Ohm.
    assert best["Contact resistance [Ohm]"] == pytest.approx(0.016, rel=0.02)
