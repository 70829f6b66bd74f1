"""A life's forecast in the folder of its run."""

import io
import json
from pathlib import Path
from typing import Any

import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.run import after_search
from bsa.core.run.run_config import RunConfig
from bsa.experiments import run
from bsa.experiments.cli.progress import PlainProgress
from bsa.experiments.cli.run import _print_summary
from bsa.experiments.run_record import read_run
from bsa_toy_cell import toy_scaffold
from bsa_toy_life import FadingLives, fading_task

CONFIG = RunConfig(scaffold=toy_scaffold(), simulations=20, rounds=1, warm_up=0)


@pytest.fixture(autouse=True)
def _on_paper(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "RunPlugins", lambda *_: FadingLives())


def executed(folder: Path, stream: io.StringIO) -> run.RunResult:
    listener = PlainProgress("%", stream)
    return run.execute_run(fading_task(), CONFIG, folder, RulesBackend(), listener=listener, analysing=True)


def records(folder: Path) -> list[Any]:
    return [one for one in json.loads((folder / "result.json").read_text())["records"] if not one["fitted"]]


@pytest.mark.slow
def test_the_forecast_is_in_the_folder_and_told_while_the_intervals_are_sought(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []

    def looked(*_: object) -> None:
        seen.extend(records(tmp_path))
        seen.append((tmp_path / "report.html").read_text())
        raise KeyboardInterrupt

    stream = io.StringIO()
    with monkeypatch.context() as patched:
        patched.setattr(after_search, "analyse", looked)
        assert executed(tmp_path, stream).cut_short
    early, page = seen
    assert early["record"] == "later"
    assert early["signals"]["capacity"]["rms"] == pytest.approx(0.0, abs=1e-9)
    assert "later" in page
    lines = stream.getvalue().splitlines()
    (told,) = [line for line in lines if "Forecast of later: capacity 0.8 A h in cycle 100, measured 0.8" in line]
    assert f"note: {tmp_path / 'report.html'} has it; its 95 % band follows." in lines
    assert lines.index("forecast: 1 of 1 simulation") < lines.index(told)
    assert records(tmp_path) == [early]

    again = io.StringIO()
    assert not executed(tmp_path, again).cut_short
    assert "Forecast of" not in again.getvalue()
    assert "band of the forecast: " in again.getvalue()
    assert records(tmp_path)[0]["bands"]
    assert not {after_search.NOT_ANALYSED, after_search.NO_BAND} & set(read_run(tmp_path).notes)


def test_the_summary_tells_the_forecast(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = run.execute_run(fading_task(), CONFIG, tmp_path, RulesBackend(), report=False)
    _print_summary(result, tmp_path, "toy-life")
    assert "\n  Forecast of later: capacity 0.8 A h in cycle 100, measured 0.8; off by " in capsys.readouterr().out
