"""An outage changes nothing of what a run finds: it waits, or it stops and goes on later."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.messages import (
    BackendFailure,
    BackendUnreachable,
    JsonSchema,
    Message,
    PromptRefused,
    PromptTooLong,
    Reply,
    Usage,
)
from bsa.core.run import recording
from bsa.core.run.journal import read_events
from bsa.core.run.loop import RunResult
from bsa_toy_cell import toy_scaffold

RunToy = Callable[..., RunResult]

TRIES = 1 + len(recording.ASK_AGAIN_AFTER_S)


class Flaky(RulesBackend):
    """The rules, with calls that fail: each number of a call, from 0, with its failure."""

    def __init__(self, failures: Mapping[int, Exception | None], always: Exception | None = None) -> None:
        super().__init__()
        self._failures = failures
        self._always = always
        self.calls = 0

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        self.calls += 1
        failure = self._failures.get(self.calls - 1, self._always)
        if failure is not None:
            raise failure
        return super().complete(messages, schema, seed=seed)


def found(result: RunResult) -> list[object]:
    trials = [(trial.index, trial.phase, dict(trial.candidate), trial.objective) for trial in result.trials]
    return [*trials, result.status, result.best.index, result.llm_calls - result.lost_calls]


@pytest.mark.slow
@pytest.mark.parametrize("scaffold", ["full", "hybrid"])
def test_a_flaky_model_finds_what_a_steady_one_finds(run_toy: RunToy, tmp_path: Path, scaffold: str) -> None:
    whole = run_toy(tmp_path / "steady", scaffold=toy_scaffold(scaffold))
    gone = BackendFailure("gone")
    # A connection that is refused before anything ever answered is given up at once: not so here.
    failures = {0: gone, 1: gone, 3: BackendUnreachable("restarting")}
    flaky = run_toy(tmp_path / "flaky", scaffold=toy_scaffold(scaffold), backend=Flaky(failures))
    assert flaky.lost_calls > 0
    assert flaky.llm_calls == whole.llm_calls + flaky.lost_calls
    assert found(flaky) == found(whole)


@pytest.mark.slow
@pytest.mark.parametrize(("scaffold", "answered"), [("full", 0), ("full", 1), ("full", 3), ("hybrid", 0)])
def test_an_outage_stops_the_run_and_is_no_result(
    run_toy: RunToy, tmp_path: Path, scaffold: str, answered: int
) -> None:
    chosen = toy_scaffold(scaffold)
    whole = run_toy(tmp_path / "whole", scaffold=chosen)
    dead = Flaky(dict.fromkeys(range(answered)), BackendFailure("time-out"))
    stopped = run_toy(tmp_path / "dead", scaffold=chosen, backend=dead, analysing=True)
    assert (stopped.status, stopped.reason) == ("outage", "the language model gave no reply: time-out")
    assert (stopped.lost_calls, stopped.llm_calls) == (TRIES, answered + TRIES)
    assert stopped.analysis is None
    written = json.loads((tmp_path / "dead" / "result.json").read_text())
    assert (written["status"], written["lost_calls"], written["reason"]) == ("outage", TRIES, stopped.reason)
    # Still down: nothing is doubled, and it says so again.
    again = run_toy(tmp_path / "dead", scaffold=chosen, backend=Flaky({}, BackendUnreachable("refused")))
    assert (again.status, len(again.trials)) == ("outage", len(stopped.trials))
    assert again.lost_calls == TRIES + 1
    resumed = run_toy(tmp_path / "dead", scaffold=chosen)
    assert found(resumed) == found(whole)
    assert resumed.lost_calls == TRIES + 1
    assert resumed.reason == ""
    report = (tmp_path / "dead" / "report.html").read_text()
    assert f"{TRIES + 1} of {resumed.llm_calls} calls of the language model gave no reply" in report


def test_a_server_that_never_was_there_is_not_waited_for(run_toy: RunToy, tmp_path: Path) -> None:
    dead = Flaky({}, BackendUnreachable("connection refused"))
    stopped = run_toy(tmp_path, scaffold=toy_scaffold(warm_up=None), backend=dead)
    assert (stopped.status, dead.calls, len(stopped.trials)) == ("outage", 1, 1)
    assert "stopped by an outage" in (tmp_path / "report.html").read_text()


def test_a_server_that_answered_before_is_waited_for(run_toy: RunToy, tmp_path: Path) -> None:
    dying = Flaky({0: None}, BackendUnreachable("connection refused"))
    stopped = run_toy(tmp_path, scaffold=toy_scaffold(warm_up=None), backend=dying)
    assert (stopped.status, dying.calls) == ("outage", 1 + TRIES)


class Fussy:
    """Refuses the prompts of its list, by number of the call, and answers nothing usable to the others."""

    name, sees_images = "fussy", False

    def __init__(self, refused: Callable[[int], bool], failure: type[PromptRefused] = PromptRefused) -> None:
        self._refused, self._failure = refused, failure
        self.calls = 0

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        self.calls += 1
        if self._refused(self.calls):
            raise self._failure("too long")
        return Reply("nothing of use")

    def close(self) -> None:
        pass


def test_rounds_without_a_word_of_the_model_do_not_use_up_the_patience(run_toy: RunToy, tmp_path: Path) -> None:
    # A round of three unusable replies, two rounds refused, and again.
    fussy = Fussy(lambda call: call % 5 in (4, 0))
    result = run_toy(tmp_path, scaffold=toy_scaffold(warm_up=None), backend=fussy, patience=3, rounds=40)
    events = list(read_events(tmp_path))
    lost = [event["lost"] for event in events if event["event"] == "proposal"]
    assert result.status == "converged"
    assert sum("too long" not in reason for reason in lost) == 3
    assert sum("too long" in reason for reason in lost) == 4
    assert found(
        run_toy(tmp_path, scaffold=toy_scaffold(warm_up=None), backend=Fussy(bool), patience=3, rounds=40)
    ) == (found(result))


def test_a_model_that_refuses_every_prompt_is_no_result_either(run_toy: RunToy, tmp_path: Path) -> None:
    fussy = Fussy(lambda call: True)
    result = run_toy(tmp_path, scaffold=toy_scaffold(warm_up=None), backend=fussy)
    assert (result.status, fussy.calls) == ("outage", recording.MOST_REFUSED)
    assert result.advice == ""
    again = Fussy(lambda call: True)
    assert run_toy(tmp_path, scaffold=toy_scaffold(warm_up=None), backend=again).status == "outage"
    assert again.calls == 1


def test_where_prompts_are_too_long_the_advice_is_what_can_help(run_toy: RunToy, tmp_path: Path) -> None:
    long = Fussy(lambda call: True, PromptTooLong)
    result = run_toy(tmp_path, scaffold=toy_scaffold(warm_up=None), backend=long)
    assert result.status == "outage"
    assert "once the model has a longer context" in result.advice
    assert "--scaffold digest" in result.advice


@pytest.mark.slow
def test_an_interrupt_while_waiting_leaves_a_run_that_goes_on(
    run_toy: RunToy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(seconds: float) -> None:
        raise KeyboardInterrupt

    whole = run_toy(tmp_path / "whole")
    with monkeypatch.context() as patched:
        patched.setattr(recording.time, "sleep", interrupt)
        stopped = run_toy(tmp_path / "cut", backend=Flaky({2: BackendFailure("gone")}))
    assert (stopped.status, stopped.lost_calls) == ("interrupted", 1)
    assert found(run_toy(tmp_path / "cut")) == found(whole)


class Telltale(RulesBackend):
    """A third party's backend that repeats what it was given, before it fails."""

    calls = 0

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        self.calls += 1
        if self.calls > 1:
            raise PromptRefused("http://me:hunter2@host refuses the key abc-123")
        return Reply("my key is abc-123", notes=("asked with abc-123",), model="abc-123")


def test_no_key_gets_into_a_journal(run_toy: RunToy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ANY_API_KEY", "abc-123")
    run_toy(tmp_path / "run", scaffold=toy_scaffold("full"), backend=Telltale())
    events = [event["event"] for event in read_events(tmp_path / "run")]
    assert {recording.REPLY, recording.LOST_CALL} <= set(events)
    for path in (tmp_path / "run").rglob("*"):
        assert path.is_dir() or not any(secret in path.read_bytes() for secret in (b"abc-123", b"hunter2")), path


class Unpriced(RulesBackend):
    """The rules, at a price that nobody knows, after a moment that they do not report."""

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        return replace(super().complete(messages, schema, seed=seed), usage=Usage(5, 5, 0, None))


def test_an_unknown_price_is_not_nothing_and_the_time_is_measured(run_toy: RunToy, tmp_path: Path) -> None:
    result = run_toy(backend=Unpriced(), scaffold=toy_scaffold("full"), rounds=2)
    assert (result.usage.cost_usd, result.usage.tokens) == (None, 10 * result.llm_calls)
    assert result.usage.seconds > 0
    assert json.loads((tmp_path / "run" / "result.json").read_text())["cost_usd"] is None
    notes = [event["text"] for event in read_events(tmp_path / "run") if event["event"] == "note"]
    assert sum("The price of this language model is not known" in note for note in notes) == 1
    assert "<dt>Cost</dt><dd>price unknown</dd>" in (tmp_path / "run" / "report.html").read_text()
