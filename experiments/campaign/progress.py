"""What a person sees while a campaign goes on: a live table in a terminal, plain lines elsewhere."""

from __future__ import annotations

import math
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TextIO

from ...core.printable import one_line
from ..cli.progress import Redrawn
from ..report.wording import duration, number
from .cell import Cell, Report
from .execution import Watcher
from .store import best_score

_LINE_EVERY_S = 5.0
_MOST_ROWS = 24


@dataclass
class Tally:
    """How far the cells of one method are."""

    # total, done, failed, running: Cells; ``done`` counts those found finished too, ``failed`` the stopped ones too.
    total: int = 0
    done: int = 0
    failed: int = 0
    running: int = 0
    best: float = math.inf  # Lowest objective.


class _Counting(Watcher, ABC):
    """Counts cells by scaffold and backend, guesses the time left from the pace so far, and tells what went wrong."""

    def __init__(self, cells: Sequence[Cell]) -> None:
        self.tallies: dict[str, Tally] = {}
        self.total = Tally()
        self.found = 0
        self._started = time.monotonic()
        self._ran = 0
        for cell in {cell.identity: cell for cell in cells if cell.identity}.values():
            self._count(cell, "total")

    def _count(self, cell: Cell, what: str, by: int = 1) -> None:
        for tally in (self.tallies.setdefault(_method(cell), Tally()), self.total):
            setattr(tally, what, getattr(tally, what) + by)

    @abstractmethod
    def say(self, line: str) -> None:
        """Show a line for good."""

    def begun(self, cell: Cell) -> None:
        """See `Watcher.begun`."""
        self._count(cell, "running")

    def ended(self, cell: Cell, report: Report, found: bool) -> None:
        """See `Watcher.ended`."""
        if found:
            self.found += 1
        else:
            self._ran += 1
            self._count(cell, "running", -1)
        self._count(cell, "done" if report.state == "done" else "failed")
        for tally in (self.tallies[_method(cell)], self.total):
            tally.best = min(tally.best, objective_of(report))
        if report.state in ("failed", "stopped", "lost"):
            self.say(f"{named(cell)}: {report.state}: {one_line(report.reason or 'interrupted', 300)}")

    def busy(self, cell: Cell) -> None:
        """See `Watcher.busy`."""
        self._count(cell, "running", -1)

    def lost(self, cell: Cell, reason: str) -> None:
        """See `Watcher.lost`."""
        self._count(cell, "running", -1)
        self.say(f"{named(cell)}: {one_line(reason, 200)}; run again")

    def noted(self, text: str) -> None:
        """See `Watcher.noted`."""
        self.say(f"note: {text}")

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return time.monotonic() - self._started

    @property
    def left_s(self) -> float:
        """Time left, s; not a number before the first cell has ended."""
        left = self.total.total - self.total.done - self.total.failed
        return self.seconds / self._ran * left if self._ran else math.nan


def objective_of(report: Report) -> float:
    """The objective of a finished cell; infinity where nothing could be compared."""
    value = best_score(report.result).get("objective")
    return math.inf if value is None else float(value)


def _method(cell: Cell) -> str:
    return one_line(f"{cell.axes.scaffold} · {cell.axes.backend}")


def named(cell: Cell) -> str:
    """A cell in words."""
    return f"{one_line(cell.axes.task)} · {_method(cell)} · seed {cell.axes.seed}"


class PlainCampaign(_Counting):
    """A line for every cell; where cells end within 5 s of each other, a line every 5 s.

    Written to standard error by default.
    """

    def __init__(self, cells: Sequence[Cell], stream: TextIO | None = None) -> None:
        super().__init__(cells)
        self._stream = stream or sys.stderr
        self._last = -math.inf
        self._unsaid = 0

    def ended(self, cell: Cell, report: Report, found: bool) -> None:
        """See `Watcher.ended`."""
        super().ended(cell, report, found)
        if found or report.state != "done":
            return
        if time.monotonic() - self._last < _LINE_EVERY_S and self._unsaid < 1000:
            self._unsaid += 1
            return
        more = f" (and {self._unsaid} more)" if self._unsaid else ""
        failed = f", {self.total.failed} failed" * bool(self.total.failed)
        count = f"[{self.total.done + self.total.failed}/{self.total.total}]"
        outcome = report.result.get("summary") or number(objective_of(report))
        self.say(f"{count} {named(cell)}: {outcome}{more}; {duration(self.left_s)} left{failed}")
        self._last, self._unsaid = time.monotonic(), 0

    def say(self, line: str) -> None:
        """Print a line."""
        print(line, file=self._stream, flush=True)

    def __enter__(self) -> PlainCampaign:
        return self

    def __exit__(self, *exception: object) -> None:
        done, total = self.total.done, self.total.total
        already = f"{self.found} were already"
        self.say(f"{done} of {total} cells done ({already}), {self.total.failed} failed, {duration(self.seconds)}")


class LiveCampaign(Redrawn, _Counting):
    """A table that is redrawn in place, a row a method."""

    def __init__(self, title: str, cells: Sequence[Cell]) -> None:
        _Counting.__init__(self, cells)
        self._title = title
        self._elsewhere = 0
        Redrawn.__init__(self)

    def tick(self, elsewhere: int) -> None:
        """See `Watcher.tick`."""
        self._elsewhere = elsewhere

    def drawn(self) -> Any:
        """See `Redrawn.drawn`."""
        from rich.table import Table
        from rich.text import Text

        table = Table(title=self._title, title_justify="left")
        table.add_column("method")
        for column in ("cells", "done", "running", "failed", "best error"):
            table.add_column(column, justify="right")
        rows = list(self.tallies.items())
        for name, tally in rows[:_MOST_ROWS]:
            table.add_row(Text(name), *_columns(tally))
        if len(rows) > _MOST_ROWS:
            table.add_row(f"… {len(rows) - _MOST_ROWS} more", "", "", "", "", "")
        table.add_section()
        table.add_row("all", *_columns(self.total))
        held = f", {self._elsewhere} held by other processes" if self._elsewhere else ""
        table.caption = f"{duration(self.seconds)} gone, {duration(self.left_s)} left{held}"
        return table


def _columns(tally: Tally) -> list[str]:
    return [str(tally.total), str(tally.done), str(tally.running), str(tally.failed), number(tally.best)]
