"""What a person sees of a run, also after its search."""

import io
import itertools
import re
from pathlib import Path

import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.messages import Usage
from bsa.core.proposal import Proposal
from bsa.core.run.journal import read_events
from bsa.core.run.run_config import RunConfig
from bsa.experiments.cli.progress import LiveProgress, PlainProgress, note_line
from bsa.experiments.run import execute_run
from bsa_toy_cell import HIDDEN, POLARISATION, SERIES, toy_scaffold, toy_task
from rich.console import Console

SHY = toy_task({**HIDDEN, SERIES: 0.0052, POLARISATION: 0.0052})
"""A cell whose record leaves something open, so that what to measure next is simulated."""


def run(folder: Path, listener: LiveProgress | PlainProgress, scaffold: str = "least-squares") -> None:
    config = RunConfig(scaffold=toy_scaffold(scaffold), rounds=60, warm_up=0, simulations=60)
    execute_run(SHY, config, folder, RulesBackend(), listener=listener, report=False, analysing=True)


PURPOSES = ("final scores", "what the record fixes", "what to measure next")


@pytest.mark.slow
def test_simulations_after_the_search_are_counted_line_by_line_where_they_take_long(tmp_path: Path) -> None:
    stream, clock = io.StringIO(), itertools.count(0, 20.0)
    run(tmp_path / "run", PlainProgress("%", stream, clock=lambda: next(clock)))
    lines = stream.getvalue().splitlines()
    for purpose in PURPOSES:
        counts = [line for line in lines if line.startswith(purpose)]
        assert len(counts) > 1
        while counts:  # one batch after the other, each from 0 to its end
            total = int(counts[0].split()[-2])
            batch, counts = counts[: total + 1], counts[total + 1 :]
            counted = [re.sub(r", about \d+ (s|min) left$", "", line) for line in batch]
            assert counted == [f"{purpose}: {done} of {total} simulations" for done in range(total + 1)]
            assert [("left" in line) for line in batch] == [0 < done < total for done in range(total + 1)]


@pytest.mark.slow
def test_quick_simulations_after_the_search_have_one_line_for_what_they_are_for(tmp_path: Path) -> None:
    stream = io.StringIO()
    run(tmp_path / "run", PlainProgress("%", stream, clock=lambda: 0.0))
    lines = stream.getvalue().splitlines()
    assert [sum(line.startswith(purpose) for line in lines) for purpose in PURPOSES] == [1, 1, 1]


@pytest.mark.slow
def test_the_panel_counts_them_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    live = LiveProgress("title", "%", 60)
    shown: list[str] = []
    counted = live.counted

    def look(purpose: str, done: int, total: int) -> None:
        counted(purpose, done, total)
        console = Console(file=io.StringIO(), width=80)
        console.print(live.drawn())
        shown.append(console.file.getvalue())  # type: ignore[attr-defined]

    monkeypatch.setattr(live, "counted", look)
    run(tmp_path / "run", live)
    assert "final scores: 2 of " in shown[2]
    assert "what to measure next: 1 of" in "".join(shown)


def test_a_run_without_a_fit_is_scored_once_and_not_judged(tmp_path: Path) -> None:
    stream = io.StringIO()
    run(tmp_path / "run", PlainProgress("%", stream), "default")
    assert stream.getvalue().splitlines()[-1] == "final scores: 1 of 1 simulation"
    events = list(read_events(tmp_path / "run"))
    assert [event["index"] for event in events if event["event"] == "score"] == [0]
    assert not [event for event in events if event["event"].startswith("appraisal")]


COMMAND = "bsa discover --data " + " ".join(f"'my  cell {place}.csv'" for place in range(40)) + " --column voltage=2"


def test_a_command_at_the_end_of_a_note_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    text = f"The misfit that is left follows the curve. To look for it: {COMMAND}"
    stream = io.StringIO()
    PlainProgress("mV", stream, COMMAND).noted(text)
    assert stream.getvalue() == f"note: {text}\n"
    live = LiveProgress("title", "mV", 60, COMMAND)
    monkeypatch.setattr(live._live, "console", Console(file=io.StringIO(), width=80))
    live.noted(text)
    assert live._live.console.file.getvalue() == f"note: {text}\n"  # type: ignore[attr-defined]


def test_other_notes_are_cut_and_a_name_in_a_command_steers_no_terminal() -> None:
    assert len(note_line("x" * 1000)) < 420
    assert len(note_line(f"{COMMAND} {'x' * 1000}", COMMAND)) < 420
    hostile = "bsa discover --data '\x1b[2Ja\n\u202e.csv'"
    assert note_line(f"Look: {hostile}", hostile) == "note: Look: bsa discover --data 'a .csv'"


def test_the_cycle_of_a_long_simulation_is_told_where_nothing_else_is_for_long() -> None:
    stream, now = io.StringIO(), [0.0]
    plain = PlainProgress("%", stream, clock=lambda: now[0])
    plain.counted("forecast", 0, 1)
    for cycle in range(1, 401):
        now[0] += 0.25
        plain.cycled(cycle, 400)
    plain.counted("band of the forecast", 3, 17)
    now[0] += 60.0
    plain.cycled(130, 400)
    *others, last = stream.getvalue().splitlines()
    assert others == [f"  forecast: cycle {cycle} of 400" for cycle in range(60, 401, 60)]
    assert last == "  band of the forecast: 3 of 17 simulations, cycle 130 of 400"


def test_the_panel_shows_the_cycle_until_something_else_begins() -> None:
    live = LiveProgress("title", "%", 60)

    def shown() -> str:
        console = Console(file=io.StringIO(), width=80)
        console.print(live.drawn())
        return console.file.getvalue()  # type: ignore[attr-defined]

    live.cycled(7, 400)
    assert "first simulation, cycle 7 of 400" in shown()
    live.counted("forecast", 0, 1)
    assert "cycle 7" not in shown()
    live.cycled(130, 400)
    assert "forecast: cycle 130 of 400" in shown()


class Asked(PlainProgress):
    def __init__(self) -> None:
        super().__init__("%", io.StringIO())
        self.usages: list[Usage] = []

    def asked(self, usage: Usage) -> None:
        self.usages.append(usage)


def test_the_panel_says_that_it_waits_for_the_model_and_what_that_cost(tmp_path: Path) -> None:
    listener = Asked()
    run(tmp_path / "run", listener, "full")
    assert len(listener.usages) == sum(event["event"] == "reply" for event in read_events(tmp_path / "run")) > 0
    live = LiveProgress("title", "%", 60)

    def shown() -> str:
        console = Console(file=io.StringIO(), width=80)
        console.print(live.drawn())
        return console.file.getvalue()  # type: ignore[attr-defined]

    assert "starting the simulator" in shown()
    assert "no tokens" in shown()
    live.asked(Usage(700, 50, 0, None))
    assert "waiting for the language model" in shown()
    assert "750 tokens, price unknown" in shown()
    live.proposed(Proposal(candidates=(), hypothesis="x"), "search", 1)
    assert "waiting" not in shown()


def test_plain_lines_say_that_a_model_is_waited_for_where_nothing_else_is_for_long() -> None:
    stream, now = io.StringIO(), [0.0]
    plain = PlainProgress("%", stream, clock=lambda: now[0])
    plain.asked(Usage())
    now[0] = 20.0
    plain.asked(Usage())
    assert stream.getvalue() == "  waiting for the language model\n"


def test_simulations_after_the_search_are_told_when_they_end_and_while_they_take_long() -> None:
    stream, now = io.StringIO(), [0.0]
    progress = PlainProgress("%", stream, clock=lambda: now[0])
    for done in range(3):
        progress.counted("final scores", done, 2)
    for done in range(4):
        progress.counted("what the record fixes", done, 3)
        now[0] += 10.0
    progress.counted("what the record fixes", 2, 2)
    assert stream.getvalue().splitlines() == [
        "final scores: 2 of 2 simulations",
        "what the record fixes: 2 of 3 simulations, about 10 s left",
        "what the record fixes: 3 of 3 simulations",
    ]


def test_every_hypothesis_has_a_line() -> None:
    stream = io.StringIO()
    progress = PlainProgress("%", stream, clock=lambda: 0.0)
    for number in (1, 2):
        progress.proposed(Proposal(candidates=(), hypothesis="smaller particles"), "search", number)
    assert stream.getvalue().splitlines() == ["search 1: smaller particles", "search 2: smaller particles"]


def test_rounds_in_the_same_words_have_one_line_and_another_one_after_a_silence() -> None:
    stream, now = io.StringIO(), [0.0]
    progress = PlainProgress("%", stream, clock=lambda: now[0])
    for number, (words, at) in enumerate(
        [("a step", 0.0), ("a step", 1.0), ("slopes", 2.0), ("a step", 3.0), ("a step", 60.0)]
    ):
        now[0] = at
        progress.proposed(Proposal(candidates=(), rationale=words), "search", number)
    assert stream.getvalue().splitlines() == [
        "search 0: a step",
        "search 2: slopes",
        "search 3: a step",
        "search 4: a step",
    ]
