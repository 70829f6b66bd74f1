"""Ctrl-C where no simulation of the search is lost: said in one line, exit code 130."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import typer
from bsa.core.run import after_search
from bsa.core.run.run_config import RunConfig
from bsa.experiments import predict
from bsa.experiments.cli.exit_codes import INTERRUPTED
from bsa.experiments.cli.main import main
from bsa.experiments.cli.run import _execute
from bsa.experiments.request import RunRequest
from bsa.experiments.run import Resources
from bsa_toy_cell import toy_scaffold, toy_task


def test_an_interrupt_after_the_search_says_how_to_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(after_search, "analyse", interrupted)
    config = RunConfig(scaffold=toy_scaffold("least-squares"), backend="rules", simulations=5, warm_up=0)
    with pytest.raises(typer.Exit) as ended:
        _execute(RunRequest(toy_task(), config, tmp_path / "run"), Resources(), False, True)
    assert ended.value.exit_code == INTERRUPTED == 130
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("Stopped: interrupted. The search is finished;")
    assert last.endswith(f"bsa-run --resume {tmp_path / 'run'}")


@pytest.mark.parametrize(("analysing", "also"), [(True, ""), (False, " --no-identifiability")])
def test_an_interrupt_of_the_final_scores_says_how_to_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, analysing: bool, also: str
) -> None:
    monkeypatch.setattr(after_search.AfterSearch, "score", interrupted)
    config = RunConfig(scaffold=toy_scaffold("least-squares"), backend="rules", simulations=5, warm_up=0)
    with pytest.raises(typer.Exit) as ended:
        _execute(RunRequest(toy_task(), config, tmp_path / "run"), Resources(), False, analysing)
    assert ended.value.exit_code == INTERRUPTED
    line = f"Stopped: interrupted. Go on with: bsa-run --resume {tmp_path / 'run'}{also}"
    assert capsys.readouterr().err.splitlines()[-1] == line


def test_an_interrupted_prediction_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(predict, "predict_records", interrupted)
    monkeypatch.setattr(sys, "argv", ["bsa", "predict", str(tmp_path), "--data", "a.csv"])
    (tmp_path / "a.csv").write_text("x")
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == INTERRUPTED
    assert capsys.readouterr().err == "Interrupted.\n"


def interrupted(*_: object, **__: object) -> None:
    raise KeyboardInterrupt
