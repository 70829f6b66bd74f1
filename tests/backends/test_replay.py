"""A run whose replies are those of another one, and what it says when they are used up."""

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer
from bsa.backends.opening import open_backend
from bsa.backends.replay import given
from bsa.core.messages import Reply
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


def reply(text: str, prompt: str) -> dict[str, Any]:
    told = [{"role": "user", "text": prompt, "images": 0}]
    return {"event": "reply", "text": text, "usage": {}, "prompt": told}


def vote(text: str, count: int) -> dict[str, Any]:
    return {"event": "vote", "text": text, "ballots": [{}] * count, "rejected": []}


def of_votes(*events: dict[str, Any]) -> list[str]:
    """What the proposer of a run with two votes was given."""
    begin = {"event": "run", "config": {"backend_options": {"votes": 2}}}
    return [one.text if isinstance(one, Reply) else type(one).__name__ for one in given([begin, *events])]


def test_votes_that_were_not_merged_were_not_given() -> None:
    whole = [reply("a", "first"), reply("b", "first"), vote("merged", 2), {"event": "proposal"}]
    assert of_votes(*whole) == ["merged"]
    assert of_votes(*whole, reply("c", "second")) == ["merged"]  # the run was stopped before the second vote
    refused = {"event": "lost-call", "reason": "too long", "refused": True, "prompt": reply("", "second")["prompt"]}
    assert of_votes(*whole, reply("c", "second"), refused) == ["merged", "PromptRefused"]
    taken_up_again = [reply("c", "second"), {"event": "resumed"}, reply("d", "second"), vote("both", 2)]
    assert of_votes(*whole, *taken_up_again) == ["merged", "both"]


def test_a_reply_that_is_no_vote_is_given_as_it_is() -> None:
    alone = [reply("measure", "first"), {"event": "proposal"}]
    assert of_votes(*alone, reply("a", "second"), reply("b", "second"), vote("merged", 2)) == ["measure", "merged"]
    assert of_votes(*alone) == ["measure"]
