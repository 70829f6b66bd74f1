"""What a person sees while a run goes on: a live panel in a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Self, TextIO

from ...core.messages import Usage
from ...core.printable import counted, duration, one_line, strip_control
from ...core.run.listener import Listener

if TYPE_CHECKING:
    from rich.panel import Panel

    from ...core.proposal import Proposal
    from ...core.trial import Phase, Trial


def note_line(text: str, command: str = "") -> str:
    """A note on one line, cut where it is long, but for a command of our own that it ends with: that can be pasted."""
    if command and text.endswith(command):
        typed = strip_control(command).replace("\n", " ")  # a file's name keeps its spaces
        return f"note: {one_line(text.removesuffix(command), 400)} {typed}"
    return f"note: {one_line(text, 400)}"


_SILENT_S = 15.0
"""Time without a line, s, after which a count of simulations or the cycle of a long one is told: shorter ones need no
progress of their own."""

_STARTING, _STARTED = "starting the simulator", "choosing what to simulate"
_WAITING = "waiting for the language model"


def cycle_words(stage: str, cycle: int, cycles: int) -> str:
    """``"forecast: cycle 130 of 400"``; of several simulations ``"final scores: 1 of 3 simulations, cycle ..."``."""
    alone = stage.removesuffix(": 0 of 1 simulation")
    return f"{stage}, cycle {cycle} of {cycles}" if alone == stage else f"{alone}: cycle {cycle} of {cycles}"


class PlainProgress(Listener):
    """Progress as lines.

    One for each better trial, for each hypothesis, for each round of a fit that does something else than the one
    before, and at the end of each group of simulations after the search; and from time to time what goes on.

    ``unit`` is that of the objective, ``command`` what a note may end with and is never cut. Progress goes to standard
    error by default, results to standard output.
    """

    def __init__(
        self,
        unit: str,
        stream: TextIO | None = None,
        command: str = "",
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._unit = unit
        self._stream = stream or sys.stderr
        self._command = command
        self._best = float("inf")
        self._stage = "start"
        self._ended = self._words = ""
        self._clock = clock
        self._said = self._began = clock()

    def proposed(self, proposal: Proposal, phase: Phase, number: int) -> None:
        """See `Listener.proposed`."""
        words = (
            f"lost: {proposal.lost}" if proposal.lost else proposal.hypothesis or proposal.rationale or proposal.action
        )
        self._stage = f"{phase} {number}"
        # Twenty steps of a fit in a row would be twenty equal lines; a model's hypothesis counts as news.
        if proposal.hypothesis or words != self._words or self._silent:
            self._say(f"{self._stage}: {one_line(words)}")
        self._words = words

    def asked(self, usage: Usage) -> None:
        """See `Listener.asked`."""
        if self._silent:
            self._say(f"  {_WAITING}")

    def tried(self, trial: Trial, best: Trial, usage: Usage) -> None:
        """See `Listener.tried`."""
        reduced = "" if trial.reduction is None else f" {trial.reduction.words}"
        if trial.failed:
            cause = trial.failure.cause if trial.failure else "nothing to compare"
            limit = f"; {one_line(trial.failure.limit, 160)}" if trial.failure and trial.failure.limit else ""
            self._say(f"  simulation {trial.index}{reduced}: failed ({one_line(cause, 120)}{limit})")
        elif reduced:
            self._say(f"  simulation {trial.index}{reduced}: ran")
        elif trial.objective < self._best:
            self._best = trial.objective
            cost = f", {usage.words}" if usage.tokens else ""
            limits = "".join(f"; {one_line(limit, 120)}" for limit in trial.limits)
            self._say(f"  simulation {trial.index}: {trial.objective:.4g} {self._unit}{cost}{limits}")

    def counted(self, purpose: str, done: int, total: int) -> None:
        """See `Listener.counted`."""
        self._stage = f"{purpose}: {done} of {counted(total, 'simulation')}"
        if done == 0:
            self._began = self._clock()
        ended = 0 < total == done
        if (ended and purpose != self._ended) or self._silent:
            # At the pace of those that are done.
            left = duration((self._clock() - self._began) / done * (total - done)) if 0 < done < total else ""
            self._say(f"{self._stage}, {left} left" if left else self._stage)
        if ended:
            self._ended = purpose

    def cycled(self, cycle: int, cycles: int) -> None:
        """See `Listener.cycled`."""
        if self._silent:
            self._say(f"  {cycle_words(self._stage, cycle, cycles)}")

    def noted(self, text: str) -> None:
        """See `Listener.noted`."""
        self._say(note_line(text, self._command))

    @property
    def _silent(self) -> bool:
        return self._clock() - self._said >= _SILENT_S

    def _say(self, line: str) -> None:
        self._said = self._clock()
        print(line, file=self._stream, flush=True)

    def __enter__(self) -> PlainProgress:
        return self

    def __exit__(self, *exception: object) -> None:
        """Nothing to put back."""


class Redrawn(ABC):
    """What is redrawn in place, also while nothing is reported: its clock goes on.

    It is drawn for the first time as soon as it is made, so that all that is shown must be there before.
    """

    def __init__(self) -> None:
        from rich.console import Console
        from rich.live import Live

        self._live = Live(console=Console(stderr=True), refresh_per_second=4, get_renderable=self.drawn)

    @abstractmethod
    def drawn(self) -> Any:
        """What stands there now, as ``rich`` draws it."""

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._live.stop()

    def say(self, line: str) -> None:
        """Print a line above it, which only the terminal breaks: what is copied from there is one line."""
        from rich.text import Text

        self._live.console.print(Text(line, style="yellow"), soft_wrap=True)


class LiveProgress(Redrawn, Listener):
    """A panel with where a run stands; ``command`` as in `PlainProgress`."""

    def __init__(self, title: str, unit: str, simulations: int, command: str = "") -> None:
        self._command = command
        self._title, self._unit, self._simulations = title, unit, simulations
        self._started = time.monotonic()
        self._state: dict[str, Any] = {"phase": _STARTING, "hypothesis": "", "count": 0, "failed": 0, "at": ""}
        self._first: float | None = None
        self._best: float | None = None
        self._usage = Usage()
        super().__init__()

    def proposed(self, proposal: Proposal, phase: Phase, number: int) -> None:
        """See `Listener.proposed`."""
        self._state |= {"phase": f"{phase}, round {number}", "at": ""}
        self._state["hypothesis"] = proposal.lost or proposal.hypothesis or proposal.rationale

    def asked(self, usage: Usage) -> None:
        """See `Listener.asked`."""
        self._usage = usage
        self._state["at"] = _WAITING

    def tried(self, trial: Trial, best: Trial, usage: Usage) -> None:
        """See `Listener.tried`."""
        self._state |= {"count": trial.index + 1, "at": ""}
        if self._state["phase"] == _STARTING:
            self._state["phase"] = _STARTED
        self._state["failed"] += trial.failed
        if self._first is None and trial.ok:
            self._first = trial.objective
        self._best = best.objective if best.ok else None
        self._usage = usage

    def counted(self, purpose: str, done: int, total: int) -> None:
        """See `Listener.counted`."""
        self._state |= {"phase": f"{purpose}: {done} of {counted(total, 'simulation')}", "at": ""}

    def cycled(self, cycle: int, cycles: int) -> None:
        """See `Listener.cycled`."""
        stage = "first simulation" if self._state["phase"] == _STARTING else self._state["phase"]
        self._state["at"] = cycle_words(stage, cycle, cycles)

    def noted(self, text: str) -> None:
        """See `Listener.noted`."""
        self.say(note_line(text, self._command))

    def drawn(self) -> Panel:
        """See `Redrawn.drawn`."""
        from rich.panel import Panel
        from rich.table import Table
        from rich.text import Text

        from ..report.wording import number

        grid = Table.grid(padding=(0, 2))
        rows = {
            "now": self._state["at"] or self._state["phase"],
            "hypothesis": one_line(self._state["hypothesis"], 160) or "–",
            "error": f"{number(self._first)} → {number(self._best)} {self._unit}",
            "simulations": f"{self._state['count']} of {self._simulations}"
            + f" ({self._state['failed']} failed)" * bool(self._state["failed"]),
            "model": self._usage.words,
            "time": f"{time.monotonic() - self._started:.0f} s",
        }
        for name, value in rows.items():
            grid.add_row(Text(name, style="bold"), Text(str(value)))
        return Panel(grid, title=Text(self._title), border_style="cyan")
