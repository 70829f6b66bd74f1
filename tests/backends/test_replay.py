"""A run whose replies are those of another one, and what it says when they are used up."""

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer
from bsa.backends.opening import open_backend
from bsa.core.run.loop import RunResult
from bsa.core.run.run_config import RunConfig
from bsa.experiments.cli.exit_codes import STOPPED
from bsa.experiments.cli.run import _execute
from bsa.experiments.request import RunRequest
from bsa.experiments.run import Resources, read_request
from bsa_toy_cell import toy_scaffold, toy_task

RunToy = Callable[..., RunResult]

SAME: dict[str, Any] = {"warm_up": 2, "rounds": 40, "patience": 40}


def candidates(result: RunResult) -> list[dict[str, float]]:
    return [dict(trial.candidate) for trial in result.trials]


@pytest.mark.slow
def test_a_replay_goes_on_once_the_repeated_run_has_as_its_advice_says(run_toy: RunToy, tmp_path: Path) -> None:
    """No reply is given a second time."""
    first = tmp_path / "first run"

    def replay() -> RunResult:
        return run_toy(tmp_path / "again", backend=open_backend(f"replay:{first}"), simulations=14, **SAME)

    short = run_toy(first, simulations=6, **SAME)
    spent = replay()
    assert spent.status == "budget-spent"
    assert candidates(spent) == candidates(short)
    assert "replies of" in spent.reason
    command = shlex.split(spent.advice.partition("(")[2].partition(")")[0])
    assert command == ["bsa-run", "--resume", str(first), "--simulations", "12"]
    assert candidates(replay()) == candidates(short)
    longer = run_toy(first, simulations=12, rebudgeted=True, **SAME)
    assert len(longer.trials) == 12
    assert candidates(replay()) == candidates(longer)


@pytest.mark.slow
def test_of_a_run_that_ended_by_itself_no_more_replies_are_promised(
    run_toy: RunToy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_toy(tmp_path / "first", simulations=30, warm_up=2, rounds=40, patience=2)
    backend = f"replay:{tmp_path / 'first'}"
    config = RunConfig(scaffold=toy_scaffold(), backend=backend, simulations=60, **SAME)
    with pytest.raises(typer.Exit) as ended:
        _execute(RunRequest(toy_task(), config, tmp_path / "again"), Resources(), False, False)
    assert ended.value.exit_code == STOPPED["budget-spent"]
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("Stopped: all ")
    assert "had ended by itself there" in last
    assert "--backend NAME" in last
    assert "--resume" not in last
    assert read_request(tmp_path / "again")[1].backend == backend
