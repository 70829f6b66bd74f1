"""Whole runs of the toy task: a random model in this process, votes, review, and a replay of what came."""

import pytest
from bsa.backends.opening import open_backend
from bsa.backends.reviewing import ReviewingBackend, Verdict
from bsa.backends.rules.backend import RulesBackend
from bsa.backends.voting import VotingBackend
from bsa.core.run.journal import read_events


def _events(folder, kind):
    return [event for event in read_events(folder) if event["event"] == kind]


@pytest.mark.slow
def test_a_run_in_this_process_and_its_replay(tiny_model, run_toy, tmp_path):
    options = {"temperature": 1.0, "max_reply_tokens": 700}
    backend = open_backend(f"transformers:{tiny_model}", options)
    budgets = {"rounds": 3, "warm_up": 4, "simulations": 20}
    first = run_toy(tmp_path / "first", backend=backend, **budgets)
    replies = _events(tmp_path / "first", "reply")
    assert first.llm_calls == len(replies) > 0
    assert {event["structured_by"] for event in replies} == {"schema"}
    assert first.usage.completion_tokens > 0
    # A random model may ask for one simulation, for several or for none.
    assert {trial.round for trial in first.trials if trial.phase == "search"} <= {1, 2, 3}
    again = run_toy(tmp_path / "again", backend=open_backend(f"replay:{tmp_path / 'first'}"), **budgets)
    assert [dict(trial.candidate) for trial in again.trials] == [dict(trial.candidate) for trial in first.trials]
    assert again.usage == first.usage


@pytest.mark.slow
def test_a_run_with_votes_and_its_replay(run_toy, tmp_path):
    result = run_toy(tmp_path / "run", backend=VotingBackend(RulesBackend(), 3), rounds=3)
    assert result.lowest.objective < result.trials[0].objective
    votes = _events(tmp_path / "run", "vote")
    assert (
        len(_events(tmp_path / "run", "reply")) == result.llm_calls == 3 * len(votes) + 1
    )  # the warm-up is not voted on
    report = (tmp_path / "run" / "report.html").read_text()
    assert report.count("<summary>Votes 4 of 4") == len(votes)
    assert f"<dd>{result.llm_calls}</dd>" in report
    again = run_toy(tmp_path / "again", backend=open_backend(f"replay:{tmp_path / 'run'}"), rounds=3)
    assert [dict(trial.candidate) for trial in again.trials] == [dict(trial.candidate) for trial in result.trials]
    assert again.usage == result.usage


def test_a_run_whose_reviewer_refuses_everything_changes_nothing(run_toy, tmp_path):
    backend = ReviewingBackend(RulesBackend(), lambda shown: Verdict("refuse", "unsafe"))
    result = run_toy(tmp_path / "run", backend=backend, rounds=2)
    assert all(trial.phase != "search" for trial in result.trials)
    reviews = _events(tmp_path / "run", "review")
    assert [review["verdict"] for review in reviews] == ["refuse"] * result.llm_calls
    prompts = [event["prompt"][-1]["text"] for event in _events(tmp_path / "run", "reply")]
    assert "the reviewer refused it: unsafe. Answer again" in prompts[1]
    assert "The reviewer refused the reply" in (tmp_path / "run" / "report.html").read_text()
