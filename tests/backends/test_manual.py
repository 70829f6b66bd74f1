"""Replay, manual, review and votes: backends without a model, or around one."""

import contextlib
import io
import json
import threading
import time
from collections import deque

import pytest
from bsa.backends import manual
from bsa.backends.manual import ExchangeBackend, TerminalBackend
from bsa.backends.opening import open_backend
from bsa.backends.replay import ReplayBackend, replay
from bsa.backends.reviewing import ReviewingBackend, TerminalReviewer, Verdict
from bsa.backends.terminal import Terminal
from bsa.backends.voting import VotingBackend
from bsa.core.errors import BsaError
from bsa.core.messages import (
    Backend,
    BackendFailure,
    BudgetSpent,
    Message,
    Outage,
    PromptRefused,
    Reply,
    ReplyRefused,
    Usage,
)
from bsa.core.proposal import apply_change
from bsa.core.run.journal import FORMAT, Journal, read_events
from bsa.core.run.recording import Recorder
from bsa.plugins.agent.conversation import ask


class Canned:
    """Gives prepared replies in turn; an exception is raised."""

    name = "canned"
    sees_images = False

    def __init__(self, *replies):
        self.replies = deque(replies)
        self.seeds = []

    def complete(self, messages, schema, *, seed):
        self.seeds.append(seed)
        reply = self.replies.popleft()
        if isinstance(reply, Exception):
            raise reply
        return Reply(
            reply if isinstance(reply, str) else json.dumps(reply), Usage(10, 5, seconds=1), "canned", "schema"
        )

    def close(self):
        pass


def _says(updates, **more):
    return {"analysis": "a", "hypothesis": "h", "updated_params": updates, "rationale": "r", **more}


def _vote(schema, *replies):
    return VotingBackend(Canned(*replies), len(replies)).complete([], schema, seed=5)


def test_all_are_backends():
    assert isinstance(VotingBackend(Canned(), 2), Backend)
    assert isinstance(ReviewingBackend(Canned()), Backend)
    assert isinstance(TerminalBackend(), Backend)


def test_votes_take_medians_of_what_a_majority_names(schema):
    reply = _vote(
        schema,
        _says({"A": "*1.1", "B": "+0.02", "C": "5"}, hypothesis="first"),
        _says({"A": "*1.2", "B": "+0.04"}, hypothesis="second"),
        _says({"A": "*4", "B": "+0.03", "D": "*2"}, hypothesis="third"),
    )
    content = json.loads(reply.text)
    assert content["updated_params"] == {"A": "*1.2", "B": "+0.03"}
    assert content["hypothesis"] == "second"
    assert reply.usage == Usage(30, 15, seconds=3)


def test_votes_without_majority_keep_what_is_named_most(schema):
    reply = _vote(schema, _says({"A": "*2"}), _says({"B": "*3"}), _says({"C": "*4"}))
    assert json.loads(reply.text)["updated_params"].keys() == {"A", "B", "C"}


def test_factors_are_averaged_as_logarithms_and_kinds_not_mixed(schema):
    reply = _vote(schema, _says({"A": "*4"}), _says({"A": "*1"}), _says({"A": "5.0"}))
    assert json.loads(reply.text)["updated_params"] == {"A": "*2"}


def test_an_absolute_value_stays_one_also_where_it_is_negative(schema):
    """An offset of a potential may be set to -0.02 V; the text "-0.02" would take 0.02 V off it."""
    reply = _vote(schema, _says({"A": -0.02}), _says({"A": -0.03}), _says({"A": -0.01, "B": "*2"}))
    updates = json.loads(reply.text)["updated_params"]
    assert updates == {"A": -0.02}
    assert apply_change(0.5, updates["A"]) == -0.02


def test_bad_votes_do_not_count(schema):
    reply = _vote(schema, _says({"A": "*2"}), "nonsense", _says({"A": "fast"}), _says({"A": "*0"}))
    assert json.loads(reply.text)["updated_params"] == {"A": "*2"}
    assert _vote(schema, "nonsense", "nonsense").text == "nonsense"


def test_the_commonest_action_wins(schema):
    reply = _vote(
        schema,
        _says({"A": "*2"}, action="set"),
        _says({"A": "*3"}, action="refine"),
        _says({"A": "*3"}, action="refine"),
    )
    content = json.loads(reply.text)
    assert (content["action"], content["updated_params"]) == ("refine", {"A": "*3"})


def test_actions_without_changes_are_votes_too(schema):
    measure = {"action": "jacobian", "params": ["A"], "rationale": "first"}
    change = _says({"A": "*2"}, action="set")
    reply = _vote(schema, change, measure, {**measure, "rationale": "second"})
    assert json.loads(reply.text) == measure
    reply = _vote(schema, measure, _says({"A": "*8"}), change)
    assert json.loads(reply.text)["updated_params"] == {"A": "*4"}


def test_each_vote_that_cannot_be_used_is_counted(schema):
    good, idle = _says({"A": "*2"}), _says({})
    for replies, problems in (
        ((good, "nonsense", idle), ("vote 2: ", "vote 3: it changes nothing")),
        (("nonsense", "more", idle, good, good, good), ("vote 2: ", "vote 3: it changes nothing", "")),
    ):
        answer = ask(VotingBackend(Canned(*replies), 3), [], schema, dict, seed=5)
        assert answer.value is not None
        assert len(answer.problems) == len(problems)
        assert all(told.startswith(begin) for told, begin in zip(answer.problems, problems, strict=True))


def test_votes_have_seeds_of_their_own_and_leave_other_questions_alone(schema):
    canned = Canned(_says({"A": "*2"}), _says({"A": "*2"}), {"perturbations": []})
    voting = VotingBackend(canned, 2)
    voting.complete([], schema, seed=5)
    assert len(set(canned.seeds)) == 2
    voting.complete([], {"properties": {"perturbations": {}}}, seed=6)
    assert canned.seeds[-1] == 6


def test_a_reviewer_accepts_edits_or_refuses(schema):
    edited = json.dumps(_says({"A": "*1.01"}))
    verdicts = deque([Verdict("accept"), Verdict("edit", edited), Verdict("refuse", "unsafe voltage")])
    shown = []

    def reviewer(text):
        shown.append(text)
        return verdicts.popleft()

    wild = "\x1b[2J" + json.dumps(_says({"A": "*9"}))
    backend = ReviewingBackend(Canned(wild, wild, wild), reviewer)
    assert backend.complete([], schema, seed=0).text == wild
    assert backend.complete([], schema, seed=0).text == edited
    with pytest.raises(ReplyRefused, match="unsafe voltage") as refusal:
        backend.complete([], schema, seed=0)
    assert (refusal.value.reply.text, refusal.value.reply.usage.tokens) == (wild, 15)
    assert all("\x1b" not in text for text in shown)


def test_a_review_at_the_terminal(schema):
    source = io.StringIO('what\ne\nnot json\n.\ne\n{"updated_params": {"A": "*2"}}\n.\nr\ntoo bold\n')
    reviewer = TerminalReviewer(Terminal(source, io.StringIO()))
    assert json.loads(reviewer("...").text) == {"updated_params": {"A": "*2"}}
    assert reviewer("...") == Verdict("refuse", "too bold")
    with pytest.raises(BudgetSpent):
        reviewer("...")


def test_a_review_in_an_editor(monkeypatch, tmp_path):
    script = tmp_path / "editor.sh"
    script.write_text("#!/bin/sh\nsed -i 's/9/2/' \"$1\"\n")
    script.chmod(0o755)
    monkeypatch.setenv("VISUAL", str(script))
    monkeypatch.setattr("sys.stdin", io.StringIO("e\n"))
    monkeypatch.setattr(Terminal, "has_screen", True)
    assert TerminalReviewer(Terminal(target=io.StringIO()))('{"a": "*9"}') == Verdict("edit", '{"a": "*2"}')


def test_an_editor_that_is_left_without_an_answer_asks_again(monkeypatch):
    monkeypatch.setenv("VISUAL", "false")
    monkeypatch.setattr("sys.stdin", io.StringIO("e\n\n"))
    monkeypatch.setattr(Terminal, "has_screen", True)
    said = io.StringIO()
    assert TerminalReviewer(Terminal(target=said))('{"a": "*9"}') == Verdict("accept")
    assert 'the editor "false" failed' in said.getvalue()


def test_replay_gives_the_journal_again(tmp_path, monkeypatch, messages, schema):
    journal = Journal(tmp_path / "runs" / "first")
    usage = {"prompt_tokens": 3, "completion_tokens": 2, "reasoning_tokens": 0, "cost_usd": 0.1, "seconds": 4.0}
    journal.append("start", format=1)
    journal.append("reply", text="{}", usage=usage, model="m", structured_by="json", notes=["n"], prompt=[])
    journal.append("lost-call", reason="gone", prompt=[], refused=False)
    journal.append("lost-call", reason="too long", prompt=[], refused=True)
    journal.close()
    monkeypatch.chdir(tmp_path)
    for run in ("first", "runs/first", str(tmp_path / "runs" / "first" / "journal.jsonl")):
        backend = open_backend(f"replay:{run}")
        assert backend.complete(messages, schema, seed=0) == Reply("{}", Usage(3, 2, 0, 0.1, 4.0), "m", "json", ("n",))
        with pytest.raises(PromptRefused, match="too long"):
            backend.complete(messages, schema, seed=0)
        with pytest.raises(BudgetSpent, match="2 replies"):
            backend.complete(messages, schema, seed=0)
    with pytest.raises(BsaError, match="holds no run"):
        replay("second")


def _recorded(folder, backend):
    """The backend as a run has it: a new process, whose journal may hold what an earlier one was told."""
    journal = Journal(folder)
    earlier = list(read_events(folder))
    if not earlier:
        journal.append("run", format=FORMAT)
    recorder = Recorder(journal, earlier)
    return recorder.around(backend), recorder, journal


def _kinds(folder):
    return [event["event"] for event in _exchanged(folder)]


def _exchanged(folder):
    return list(read_events(folder))[1:]


def test_every_reply_and_every_vote_stands_in_the_journal(tmp_path, schema):
    replies = (_says({"A": "*1.1"}), "nonsense", _says({"A": "*1.3"}))
    backend, recorder, journal = _recorded(tmp_path, VotingBackend(Canned(*replies), 3))
    merged = backend.complete([], schema, seed=5)
    journal.close()
    assert _kinds(tmp_path) == ["reply", "reply", "reply", "vote"]
    *written, vote = _exchanged(tmp_path)
    assert [event["text"] for event in written] == [json.dumps(replies[0]), "nonsense", json.dumps(replies[2])]
    assert vote["text"] == merged.text
    assert [ballot["changes"] for ballot in vote["ballots"]] == [{"A": "*1.1"}, {}, {"A": "*1.3"}]
    assert [bool(ballot["problem"]) for ballot in vote["ballots"]] == [False, True, False]
    assert "median" in vote["rule"]
    assert (recorder.calls, recorder.usage) == (3, merged.usage)
    assert vote["rejected"] == list(merged.rejected) == [f"vote 2: {vote['ballots'][1]['problem']}"]
    assert ReplayBackend(read_events(tmp_path), "again").complete([], schema, seed=0).rejected == merged.rejected


@pytest.mark.parametrize("kept", range(5))
def test_votes_cut_off_anywhere_come_out_the_same(tmp_path, schema, kept):
    replies = [_says({"A": f"*1.{number}"}, hypothesis=str(number)) for number in range(3)]
    backend, _, journal = _recorded(tmp_path / "whole", VotingBackend(Canned(*replies), 3))
    whole = backend.complete([], schema, seed=5)
    journal.close()
    lines = (tmp_path / "whole" / "journal.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "cut").mkdir()
    (tmp_path / "cut" / "journal.jsonl").write_bytes(b"".join(lines[: 1 + kept]))
    canned = Canned(*replies[kept:])
    backend, recorder, journal = _recorded(tmp_path / "cut", VotingBackend(canned, 3))
    assert backend.complete([], schema, seed=5) == whole
    journal.close()
    assert (recorder.calls, recorder.usage) == (3, whole.usage)
    assert _kinds(tmp_path / "cut") == _kinds(tmp_path / "whole")
    assert ReplayBackend(read_events(tmp_path / "cut"), "again").complete([], schema, seed=0) == whole


def test_a_vote_that_is_lost_is_asked_again_and_at_last_ends_the_run(tmp_path, schema):
    answers = (_says({"A": "*2"}), BackendFailure("gone"), _says({"A": "*4"}))
    backend, recorder, journal = _recorded(tmp_path, VotingBackend(Canned(*answers), 2))
    assert json.loads(backend.complete([], schema, seed=5).text)["updated_params"] == {"A": "*2.82843"}
    assert (recorder.calls, recorder.lost) == (3, 1)
    journal.close()
    lost = [BackendFailure("gone")] * 4
    backend, recorder, journal = _recorded(tmp_path / "dead", VotingBackend(Canned(_says({"A": "*2"}), *lost), 2))
    with pytest.raises(Outage, match="gone"):
        backend.complete([], schema, seed=5)
    journal.close()
    assert _kinds(tmp_path / "dead") == ["reply", *["lost-call"] * 4]


def test_a_review_is_an_event_and_nobody_is_asked_twice(tmp_path, schema):
    wild, edited = json.dumps(_says({"A": "*9"})), json.dumps(_says({"A": "*1.01"}))
    verdicts = deque([Verdict("accept"), Verdict("edit", edited), Verdict("refuse", "unsafe voltage")])

    def asked(backend):
        replies = []
        for _ in range(3):
            try:
                replies.append(backend.complete([], schema, seed=0))
            except ReplyRefused as refusal:
                replies.append((refusal.reply, refusal.reason))
        return replies

    backend, _, journal = _recorded(
        tmp_path, ReviewingBackend(Canned(wild, wild, wild), lambda text: verdicts.popleft())
    )
    first = asked(backend)
    journal.close()
    events = _exchanged(tmp_path)
    assert _kinds(tmp_path) == ["reply", "review"] * 3
    assert {event["text"] for event in events[::2]} == {wild}
    assert [(event["verdict"], event["text"]) for event in events[1::2]] == [
        ("accept", ""),
        ("edit", edited),
        ("refuse", "unsafe voltage"),
    ]
    # The reviewer of the second process has no verdict left: asked, it would fail.
    backend, recorder, journal = _recorded(tmp_path, ReviewingBackend(Canned(), lambda text: verdicts.popleft()))
    assert asked(backend) == first
    journal.close()
    assert recorder.calls == 3
    assert len(_exchanged(tmp_path)) == 6
    assert asked(ReplayBackend(read_events(tmp_path), "again")) == first


def test_a_person_at_the_terminal(messages, schema):
    target = io.StringIO()
    source = io.StringIO('{"a":\n 1}\nI think\n{"b": 2}\n.\n')
    backend = TerminalBackend(Terminal(source, target))
    first = backend.complete([*messages, Message("user", "\x1b[2Jwild")], schema, seed=0)
    assert json.loads(first.text) == {"a": 1}
    assert backend.complete(messages, schema, seed=0).text == 'I think\n{"b": 2}\n'
    with pytest.raises(BudgetSpent):
        backend.complete(messages, schema, seed=0)
    assert "## What to do" in target.getvalue()
    assert "\x1b" not in target.getvalue()


def test_an_exchange_of_files(tmp_path, messages, schema):
    folder = tmp_path / "exchange"
    backend = open_backend("manual", {"exchange": folder, "timeout_s": 20})

    def other_program():
        for number in (1, 2):
            path = folder / f"prompt-{number:03d}.json"
            while not path.is_file():
                time.sleep(0.02)
            prompt = json.loads(path.read_text())
            assert prompt["messages"][1]["text"] == messages[1].text
            with open(folder / prompt["reply"], "w") as file:
                file.write('{"numb')
                file.flush()
                file.write(f'er": {number}}}')

    thread = threading.Thread(target=other_program)
    thread.start()
    replies = [json.loads(backend.complete(messages, schema, seed=seed).text) for seed in (1, 2)]
    thread.join()
    assert replies == [{"number": 1}, {"number": 2}]
    assert not list(folder.glob(".*"))


def test_an_interrupted_exchange_waits_for_the_same_reply(tmp_path, messages, schema):
    with pytest.raises(BackendFailure, match=r"reply-001\.txt within"):
        ExchangeBackend(tmp_path, timeout_s=0.1).complete(messages, schema, seed=1)
    (tmp_path / "reply-001.txt").write_text('{"a": 1}')
    assert ExchangeBackend(tmp_path, timeout_s=5).complete(messages, schema, seed=1).text == '{"a": 1}'
    (tmp_path / "reply-002.txt").write_text('{"stale": 1}')
    with pytest.raises(BackendFailure, match=r"reply-003\.txt within"):
        ExchangeBackend(tmp_path, timeout_s=0.1).complete(messages, schema, seed=9)


def test_askers_of_one_folder_have_a_number_each(tmp_path, messages, schema, monkeypatch):
    write_json, numbers = manual.write_json, []

    def slowly(path, content, indent):
        time.sleep(0.05)  # a busy disk: all would have chosen their number by then
        numbers.append(content["number"])
        write_json(path, content, indent=indent)

    monkeypatch.setattr(manual, "write_json", slowly)

    def ask(seed):
        with contextlib.suppress(BackendFailure):
            ExchangeBackend(tmp_path, timeout_s=0.0).complete(messages, schema, seed=seed)

    askers = [threading.Thread(target=ask, args=(seed,)) for seed in range(3)]
    for asker in askers:
        asker.start()
    for asker in askers:
        asker.join()
    assert sorted(numbers) == [1, 2, 3]
    assert {json.loads(path.read_text())["seed"] for path in tmp_path.glob("prompt-*.json")} == {0, 1, 2}


def test_an_exchange_says_what_it_waits_for_and_why_a_reply_was_refused(tmp_path, schema, capsys):
    backend = ExchangeBackend(tmp_path, timeout_s=0.0)
    refusal = "That reply cannot be used: no such\nparameter. Answer again."
    for text in ("Propose.", refusal):
        with pytest.raises(BackendFailure):
            backend.complete([Message("user", text)], schema, seed=1)
    assert capsys.readouterr().err.splitlines() == [
        f"note: Waiting for {tmp_path / 'reply-001.txt'}, the reply to prompt-001.json.",
        "note: That reply cannot be used: no such parameter. Answer again. "
        f"Waiting for {tmp_path / 'reply-002.txt'}, the reply to prompt-002.json.",
    ]
