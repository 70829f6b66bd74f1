import json
import signal
from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.errors import BsaError
from bsa.core.hooks import hookimpl
from bsa.core.messages import BackendFailure, BudgetSpent, JsonSchema, Message, Reply
from bsa.core.proposal import Proposal
from bsa.core.run.journal import FILE_NAME, Journal, read_events
from bsa.core.run.loop import RunResult
from bsa.experiments.cli.progress import PlainProgress
from bsa.experiments.cli.run import _print_summary
from bsa.experiments.run_record import read_run
from bsa.plugins.proposers.random import RandomProposer
from bsa_toy_cell import CAPACITY, HIDDEN, POLARISATION, SERIES, toy_scaffold, toy_task

RunToy = Callable[..., RunResult]


def fingerprint(result: RunResult) -> list[object]:
    return [(trial.index, trial.phase, dict(trial.candidate), trial.objective) for trial in result.trials] + [
        result.status,
        result.best.index,
    ]


def test_the_agent_finds_the_hidden_cell(run_toy: RunToy) -> None:
    result = run_toy()
    assert result.initial_metrics is not None
    assert result.best_metrics is not None
    assert result.best_metrics.mape < 0.01 * result.initial_metrics.mape
    assert result.best.candidate[CAPACITY] == pytest.approx(HIDDEN[CAPACITY], rel=0.005)
    total = result.best.candidate[SERIES] + result.best.candidate[POLARISATION]
    assert total == pytest.approx(HIDDEN[SERIES] + HIDDEN[POLARISATION], rel=0.05)


def test_budgets_are_kept(run_toy: RunToy) -> None:
    result = run_toy(simulations=11)
    assert len(result.trials) == 11
    assert result.status == "simulations-spent"
    assert [trial.phase for trial in result.trials].count("warm-up") == 8


@pytest.mark.slow
def test_a_resumed_run_equals_an_uninterrupted_one_wherever_it_was_cut(run_toy: RunToy, tmp_path: Path) -> None:
    short = {"warm_up": 4, "rounds": 6, "simulations": 14}
    whole = fingerprint(run_toy(tmp_path / "whole", **short))
    lines = (tmp_path / "whole" / FILE_NAME).read_bytes().splitlines(keepends=True)
    for kept in range(1, len(lines)):
        folder = tmp_path / f"cut-{kept}"
        folder.mkdir()
        # A kill may tear the line being written.
        (folder / FILE_NAME).write_bytes(b"".join(lines[:kept]) + lines[kept][: len(lines[kept]) // 2])
        resumed = run_toy(folder, **short)
        assert fingerprint(resumed) == whole
        events = list(read_events(folder))
        indices = [event["index"] for event in events if event["event"] == "trial"]
        assert sorted(indices) == sorted(set(indices)) == list(range(len(resumed.trials)))
        replies = [event for event in events if event["event"] == "reply"]
        assert len(replies) == resumed.llm_calls


def test_a_journal_of_another_configuration_is_refused(run_toy: RunToy, tmp_path: Path) -> None:
    run_toy(tmp_path, rounds=1)
    with pytest.raises(BsaError, match="belongs to another task or configuration"):
        run_toy(tmp_path, rounds=2)
    with pytest.raises(BsaError, match="belongs to another task or configuration"):
        run_toy(tmp_path, rounds=1, task=toy_task(name="other"))


def test_failed_simulations_are_trials_and_not_the_end(run_toy: RunToy) -> None:
    scaffold = toy_scaffold(simulator={"use": "toy-cell", "options": {"breaks_above_ohm": 0.04}})
    result = run_toy(scaffold=scaffold)
    assert not result.trials[0].ok
    assert result.trials[0].feedback.content["events"][0] == "simulation_failed: the toy solver gave up"
    assert result.initial_metrics is None or result.initial_metrics.mape > 0
    assert len(result.trials) > 1


def test_a_method_without_candidates_ends_by_rounds_or_patience(
    run_toy: RunToy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever such a round says of itself, it spends no simulation: without a limit it would be asked for ever."""
    nothing = Proposal((), by_simulations=True, lost="nothing comes to mind")
    monkeypatch.setattr(RandomProposer, "propose", hookimpl(lambda self, context: nothing))
    scaffold = toy_scaffold("random")
    assert run_toy(tmp_path / "a", scaffold=scaffold, rounds=3, patience=9).status == "rounds-spent"
    assert run_toy(tmp_path / "b", scaffold=scaffold, rounds=9, patience=3).status == "converged"


class Scripted:
    """Answers with the given texts, one a call."""

    name, sees_images = "scripted", False

    def __init__(self, *texts: str) -> None:
        self._texts = list(texts)
        self.prompts: list[list[Message]] = []

    def complete(self, messages: list[Message], schema: JsonSchema, *, seed: int) -> Reply:
        self.prompts.append(list(messages))
        if not self._texts:
            raise BackendFailure("gone")
        return Reply(self._texts.pop(0))

    def close(self) -> None:
        pass


def reply(**updates: object) -> str:
    return json.dumps({"analysis": "a", "hypothesis": "h", "updated_params": updates, "rationale": "r"})


def test_bad_replies_are_asked_again_with_the_error_and_then_lost(run_toy: RunToy) -> None:
    bad = [reply(Nonsense="*1.1"), "no JSON at all", reply(**{"Capacity [A.h]": "nan"})]
    good = reply(**{"Capacity [A.h]": "*1.3"})
    backend = Scripted(*bad, *bad[:2], good)
    result = run_toy(scaffold=toy_scaffold(warm_up=None), backend=backend, rounds=3)
    events = list(read_events(result_folder(result, backend)))
    proposals = [event for event in events if event["event"] == "proposal"]
    assert proposals[0]["candidates"] == 0
    assert "Nonsense" in proposals[0]["lost"]
    assert proposals[1]["candidates"] == 1
    assert (len(proposals), result.status, result.reason) == (2, "outage", "the language model gave no reply: gone")
    assert "cannot be used" in backend.prompts[1][-1].text
    assert len(result.trials) == 2


def test_replies_that_cannot_be_used_are_counted_and_said(
    run_toy: RunToy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    backend = Scripted(*["no JSON at all"] * 4, reply(**{"Capacity [A.h]": "*1.3"}))
    result = run_toy(scaffold=toy_scaffold(warm_up=None), backend=backend, rounds=2)
    assert (result.unusable_replies, result.lost_rounds, result.llm_calls) == (4, 1, 5)
    written = json.loads((tmp_path / "run" / "result.json").read_text())
    assert (written["unusable_replies"], written["lost_rounds"]) == (4, 1)
    assert "4 of 5 replies could not be used, 1 round lost" in (tmp_path / "run" / "report.html").read_text()
    _print_summary(result, tmp_path / "run", "toy-cell")
    assert "(0 failed), 4 of 5 replies could not be used, 1 round lost, " in capsys.readouterr().out


def test_values_that_were_simulated_before_are_told_to_the_model_and_the_reader(
    run_toy: RunToy, tmp_path: Path
) -> None:
    same = reply(**{"Capacity [A.h]": "9.0"})
    backend = Scripted(same, same, same)
    listener = Mock(spec=PlainProgress)
    run_toy(scaffold=toy_scaffold(warm_up=None), backend=backend, listener=listener, rounds=3)
    (told_once,) = [call.args[0] for call in listener.noted.call_args_list if "again; it counts" in call.args[0]]
    assert told_once.startswith("Simulation 2 has the values of simulation 1")
    told = '"values_were_simulated_before_as_trial":{"2":1}'
    assert [told in messages[-1].text.replace(" ", "") for messages in backend.prompts] == [False, False, True]
    rounds = read_run(tmp_path / "run").rounds
    assert [dict(one.repeats) for one in rounds] == [{}, {2: 1}, {3: 1}]
    assert "Simulation 3 repeats the values of simulation 1." in (tmp_path / "run" / "report.html").read_text()


def result_folder(result: RunResult, backend: Scripted) -> Path:
    assert result.trials
    return FOLDER[0]


FOLDER: list[Path] = []


@pytest.fixture(autouse=True)
def _remember_folder(tmp_path: Path) -> None:
    FOLDER[:] = [tmp_path / "run"]


def test_out_of_range_values_are_projected_and_recorded(run_toy: RunToy) -> None:
    backend = Scripted(reply(**{"Capacity [A.h]": "1e6"}))
    result = run_toy(scaffold=toy_scaffold(warm_up=None), backend=backend, rounds=1)
    assert result.trials[1].candidate["Capacity [A.h]"] == 3.0
    proposal = next(event for event in read_events(FOLDER[0]) if event["event"] == "proposal")
    assert proposal["details"]["projected"] == ["Capacity [A.h]"]


class Interrupting(RulesBackend):
    """Presses Ctrl-C during the given call."""

    def __init__(self, call: int) -> None:
        super().__init__()
        self._left = call

    def complete(self, messages: list[Message], schema: JsonSchema, *, seed: int) -> Reply:
        self._left -= 1
        if self._left < 0:
            raise KeyboardInterrupt
        return super().complete(messages, schema, seed=seed)


@pytest.mark.slow
def test_an_interrupt_leaves_a_run_that_can_be_resumed(run_toy: RunToy, tmp_path: Path) -> None:
    whole = fingerprint(run_toy(tmp_path / "whole"))
    stopped = run_toy(tmp_path / "stopped", backend=Interrupting(2))
    assert stopped.status == "interrupted"
    assert (tmp_path / "stopped" / "result.json").exists()
    assert fingerprint(run_toy(tmp_path / "stopped")) == whole


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("index", [0, 3])
def test_an_interrupt_while_a_trial_is_written_leaves_it_in_result_and_report(
    run_toy: RunToy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, index: int
) -> None:
    append = Journal.append

    def interrupted(journal: Journal, event: str, **fields: object) -> None:
        append(journal, event, **fields)
        if event == "trial" and fields["index"] == index:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Journal, "append", interrupted)
    stopped = run_toy(tmp_path / "run")
    assert stopped.status == "interrupted"
    assert [trial.index for trial in stopped.trials] == list(range(index + 1))
    assert (tmp_path / "run" / "report.html").exists()


class Spending(RulesBackend):
    """Has its allowance spent at the given call."""

    def __init__(self, call: int) -> None:
        super().__init__()
        self._left = call

    def complete(self, messages: list[Message], schema: JsonSchema, *, seed: int) -> Reply:
        self._left -= 1
        if self._left < 0:
            raise BudgetSpent("10 tokens used")
        return super().complete(messages, schema, seed=seed)


@pytest.mark.slow
def test_a_spent_allowance_stops_cleanly_and_resumably(run_toy: RunToy, tmp_path: Path) -> None:
    whole = fingerprint(run_toy(tmp_path / "whole"))
    assert run_toy(tmp_path / "spent", backend=Spending(3)).status == "budget-spent"
    assert fingerprint(run_toy(tmp_path / "spent")) == whole


def test_the_candidate_in_the_journal_must_be_the_one_proposed(run_toy: RunToy, tmp_path: Path) -> None:
    run_toy(tmp_path, rounds=2)
    path = tmp_path / FILE_NAME
    lines = path.read_text().splitlines(keepends=True)
    for number, line in enumerate(lines):
        event = json.loads(line)
        if event["event"] == "trial" and event["index"] == 3:
            event["candidate"]["Capacity [A.h]"] *= 1.01
            lines[number] = json.dumps(event) + "\n"
    path.write_text("".join(lines))
    with pytest.raises(BsaError, match="simulation 3 of"):
        run_toy(tmp_path, rounds=2)


@pytest.mark.slow
def test_memory_and_structured_feedback_help_the_rules_backend(run_toy: RunToy, tmp_path: Path) -> None:
    best = {
        name: run_toy(tmp_path / name, scaffold=toy_scaffold(name), rounds=12).lowest.objective
        for name in ("full", "no-memory", "scalar-only")
    }
    assert best["full"] < 0.2 * best["no-memory"]
    assert best["full"] < 0.2 * best["scalar-only"]


def test_residuals_in_the_journal_are_exact(run_toy: RunToy, tmp_path: Path) -> None:
    first = run_toy(tmp_path, rounds=2)
    again = run_toy(tmp_path, rounds=2)
    for a, b in zip(first.trials, again.trials, strict=True):
        assert a.residuals is not None
        assert b.residuals is not None
        assert np.array_equal(a.residuals, b.residuals)
