"""What a person sees while a campaign goes on: a live table in a terminal, plain lines elsewhere."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TextIO

from ..cli.progress import printable
from ..report.wording import duration
from .cell import Cell, Report

_LINE_EVERY_S = 5.0
_MOST_ROWS = 24


@dataclass
class Tally:
    """How far the cells of one method are.

    Attributes
    ----------
    total, done, failed, running : int
        Cells; ``done`` counts those found finished too, ``failed`` the stopped ones too.
    best : float
        Lowest objective.
    """

    total: int = 0
    done: int = 0
    failed: int = 0
    running: int = 0
    best: float = math.inf


class Counter:
    """Counts cells by scaffold and backend, and guesses the time left from the pace so far."""

    def __init__(self, cells: Sequence[Cell], workers: int) -> None:
        self.tallies: dict[str, Tally] = {}
        self.total = Tally()
        self._workers = max(workers, 1)
        self._started = time.monotonic()
        self._ran = 0
        for cell in {cell.identity: cell for cell in cells if cell.identity}.values():
            self._tally(cell).total += 1
            self.total.total += 1

    def _tally(self, cell: Cell) -> Tally:
        return self.tallies.setdefault(_method(cell), Tally())

    def begun(self, cell: Cell) -> None:
        """A cell was handed out."""
        for tally in (self._tally(cell), self.total):
            tally.running += 1

    def back(self, cell: Cell) -> None:
        """A cell was handed back unfinished."""
        for tally in (self._tally(cell), self.total):
            tally.running = max(tally.running - 1, 0)

    def ended(self, cell: Cell, report: Report, found: bool) -> None:
        """A cell came to an end."""
        if not found:
            self.back(cell)
            self._ran += 1
        objective = objective_of(report)
        for tally in (self._tally(cell), self.total):
            tally.done += report.state == "done"
            tally.failed += report.state != "done"
            tally.best = min(tally.best, objective)

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
    value = (report.result.get("best") or {}).get("objective")
    return math.inf if value is None else float(value)


def _method(cell: Cell) -> str:
    return f"{cell.axes['scaffold']} · {cell.axes['backend']}"


def named(cell: Cell) -> str:
    """A cell in words."""
    return f"{cell.axes['task']} · {_method(cell)} · seed {cell.axes['seed']}"


class PlainCampaign:
    """A line for every cell; where they come thick and fast, a line every few seconds.

    Parameters
    ----------
    cells : sequence of Cell
        The campaign.
    workers : int
        Cells side by side.
    stream : TextIO, optional
        Where to write; standard error by default.
    """

    def __init__(self, cells: Sequence[Cell], workers: int, stream: TextIO | None = None) -> None:
        self._count = Counter(cells, workers)
        self._stream = stream or sys.stderr
        self._last = -math.inf
        self._unsaid = 0
        self._found = 0

    def begun(self, cell: Cell) -> None:
        """See `Watcher.begun`."""
        self._count.begun(cell)

    def ended(self, cell: Cell, report: Report, found: bool) -> None:
        """See `Watcher.ended`."""
        self._count.ended(cell, report, found)
        if found:
            self._found += 1
            return
        if report.state in ("failed", "stopped", "lost"):
            self._say(f"{named(cell)}: {report.state}: {printable(report.reason or 'interrupted', 300)}")
        elif time.monotonic() - self._last < _LINE_EVERY_S and self._unsaid < 1000:
            self._unsaid += 1
        else:
            self._say(self._line(cell, report))

    def _line(self, cell: Cell, report: Report) -> str:
        total = self._count.total
        more = f" (and {self._unsaid} more)" if self._unsaid else ""
        self._last, self._unsaid = time.monotonic(), 0
        return (
            f"[{total.done + total.failed}/{total.total}] {named(cell)}: {_outcome(report)}{more}"
            f"; {duration(self._count.left_s)} left" + f", {total.failed} failed" * bool(total.failed)
        )

    def lost(self, cell: Cell, reason: str) -> None:
        """See `Watcher.lost`."""
        self._count.back(cell)
        self._say(f"{named(cell)}: {printable(reason, 200)}; run again")

    def noted(self, text: str) -> None:
        """See `Watcher.noted`."""
        self._say(f"note: {text}")

    def tick(self, running: int, waiting: int, elsewhere: int) -> None:
        """See `Watcher.tick`."""

    def _say(self, line: str) -> None:
        print(line, file=self._stream, flush=True)

    def __enter__(self) -> PlainCampaign:
        return self

    def __exit__(self, *exception: object) -> None:
        total = self._count.total
        self._say(
            f"{total.done} of {total.total} cells done ({self._found} were already), {total.failed} failed, "
            f"{duration(self._count.seconds)}"
        )


class LiveCampaign:
    """A table that is redrawn in place, a row a method."""

    def __init__(self, title: str, cells: Sequence[Cell], workers: int) -> None:
        from rich.console import Console
        from rich.live import Live

        self._title = title
        self._count = Counter(cells, workers)
        self._elsewhere = 0
        self._live = Live(console=Console(stderr=True), refresh_per_second=4, get_renderable=self._table)

    def __enter__(self) -> LiveCampaign:
        self._live.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._live.stop()

    def begun(self, cell: Cell) -> None:
        """See `Watcher.begun`."""
        self._count.begun(cell)

    def ended(self, cell: Cell, report: Report, found: bool) -> None:
        """See `Watcher.ended`."""
        self._count.ended(cell, report, found)
        if report.state in ("failed", "stopped", "lost"):
            self._note(f"{named(cell)}: {report.state}: {printable(report.reason or 'interrupted', 300)}")

    def lost(self, cell: Cell, reason: str) -> None:
        """See `Watcher.lost`."""
        self._count.back(cell)
        self._note(f"{named(cell)}: {printable(reason, 200)}; run again")

    def noted(self, text: str) -> None:
        """See `Watcher.noted`."""
        self._note(f"note: {text}")

    def tick(self, running: int, waiting: int, elsewhere: int) -> None:
        """See `Watcher.tick`."""
        self._elsewhere = elsewhere

    def _note(self, text: str) -> None:
        from rich.text import Text

        self._live.console.print(Text(text, style="yellow"))

    def _table(self) -> Any:
        from rich.table import Table

        table = Table(title=self._title, title_justify="left")
        table.add_column("method")
        for column in ("cells", "done", "running", "failed", "best error"):
            table.add_column(column, justify="right")
        rows = list(self._count.tallies.items())
        for name, tally in rows[:_MOST_ROWS]:
            table.add_row(name, *_columns(tally))
        if len(rows) > _MOST_ROWS:
            table.add_row(f"… {len(rows) - _MOST_ROWS} more", "", "", "", "", "")
        table.add_section()
        table.add_row("all", *_columns(self._count.total))
        held = f", {self._elsewhere} held by other processes" if self._elsewhere else ""
        table.caption = f"{duration(self._count.seconds)} gone, {duration(self._count.left_s)} left{held}"
        return table


def _outcome(report: Report) -> str:
    return str(report.result.get("summary") or _number(objective_of(report)))


def _columns(tally: Tally) -> list[str]:
    return [str(tally.total), str(tally.done), str(tally.running), str(tally.failed), _number(tally.best)]


def _number(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else "–"
