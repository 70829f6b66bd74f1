"""Carries out what is missing of a campaign: hands out cells, takes back reports, looks again at what others hold."""

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from ...core.run.allowance import UNLIMITED, Allowance
from .cell import Cell, Report
from .store import Store

LOSSES = 3
"""How often in a row the worker of a cell may die without the cell having come any further."""

NOBODY_S = 60.0
"""After so long without a single worker this is said; the campaign waits on, for a cluster may be slow to give one."""

_LOOK_AGAIN_S = 1.0
_TICK_S = 0.5


class Pool(Protocol):
    """Workers, wherever they are."""

    @property
    def free(self) -> int:
        """How many more cells may be handed over now."""

    @property
    def workers(self) -> int:
        """How many cells run side by side."""

    def submit(self, cell: Cell, store: Store) -> None:
        """Hand over a cell of a store; `free` was at least 1."""

    def collect(self, patience_s: float) -> Sequence[Report]:
        """Wait until a report is there, ``patience_s`` at most. A worker that died reports its cell as lost."""

    def close(self) -> None:
        """End the workers at once; what they were doing stands in its journal."""


class Watcher:
    """Watches a campaign, for progress on a screen; does nothing with what a class derived from it passes over."""

    def begun(self, cell: Cell) -> None:
        """A cell was handed out."""

    def ended(self, cell: Cell, report: Report, found: bool) -> None:
        """A cell came to an end; ``found`` if it was finished before, or by another process."""

    def busy(self, cell: Cell) -> None:
        """Another process has the cell; it will be looked at again."""

    def lost(self, cell: Cell, reason: str) -> None:
        """A worker died; the cell will be run again elsewhere."""

    def noted(self, text: str) -> None:
        """Something worth saying happened."""

    def tick(self, elsewhere: int) -> None:
        """Time passed; other processes have so many cells."""


@dataclass
class _CampaignState:
    """Where every cell stands."""

    todo: deque[Cell] = field(default_factory=deque)
    running: dict[str, Cell] = field(default_factory=dict)
    elsewhere: dict[str, tuple[float, Cell]] = field(default_factory=dict)
    reports: dict[str, Report] = field(default_factory=dict)
    # Size of a cell's journals when its worker died, and how often that was so since it last came further.
    losses: dict[str, tuple[int, int]] = field(default_factory=dict)
    # tokens, cost_usd: Of all cells so far; ``spent`` has them by cell, for one may end several times.
    tokens: int = 0
    cost_usd: float = 0.0
    spent: dict[str, tuple[int, float]] = field(default_factory=dict)


def run_cells(
    cells: Sequence[Cell], store: Store, pool: Pool, watcher: Watcher, allowance: Allowance = UNLIMITED
) -> dict[str, Report]:
    """Run what is missing; two processes may do so side by side.

    Cells without an identity cannot be run, and are left out; the pool is left open. The ``allowance`` is that of all
    cells that this process runs, however they end, with what a cell that is taken up again had cost before; once it is
    spent, no further cell is begun. Gives what became of each cell, by identity; those not begun are missing.
    """
    state = _CampaignState()
    unique = {cell.identity: cell for cell in cells if cell.identity}
    for identity, cell in unique.items():
        result = store.result(identity)
        if result is None:
            state.todo.append(cell)
        else:
            report = state.reports[identity] = Report(identity, "done", result)
            watcher.ended(cell, report, found=True)
    last_worker_at = time.monotonic()
    while state.todo or state.running or state.elsewhere:
        spent = bool(allowance.spent(state.tokens, state.cost_usd))
        while state.todo and pool.free > 0 and not spent:
            cell = state.todo.popleft()
            state.running[cell.identity] = cell
            pool.submit(cell, store)
            watcher.begun(cell)
        if not state.running and spent:
            break
        for report in pool.collect(_TICK_S if state.running else 0.0):
            _take(state, report, store, watcher)
        if not state.running and state.elsewhere:
            time.sleep(_LOOK_AGAIN_S / 4)
        _look_again(state)
        if pool.workers:
            last_worker_at = time.monotonic()
        elif time.monotonic() - last_worker_at > NOBODY_S:
            watcher.noted(f"no worker for {NOBODY_S:.0f} s; waiting for one")
            last_worker_at = time.monotonic()
        watcher.tick(len(state.elsewhere))
    return state.reports


def _take(state: _CampaignState, report: Report, store: Store, watcher: Watcher) -> None:
    cell = state.running.pop(report.identity)
    if report.state == "busy":
        state.elsewhere[report.identity] = (time.monotonic() + _LOOK_AGAIN_S, cell)
        watcher.busy(cell)
        return
    _enter_cost(state, report, store)
    if report.state == "lost" and not _hopeless(state, report, store):
        watcher.lost(cell, report.reason)
        state.todo.appendleft(cell)
        return
    state.reports[cell.identity] = report
    watcher.ended(cell, report, found=False)


def _enter_cost(state: _CampaignState, report: Report, store: Store) -> None:
    """Enter what a cell has cost: a result tells it; of a cell that ended without one its journal does."""
    if report.result:
        tokens, cost_usd = report.result.get("tokens"), report.result.get("cost_usd")
    else:
        usage = store.usage(report.identity)
        tokens, cost_usd = usage.tokens, usage.cost_usd
    before = state.spent.get(report.identity, (0, 0.0))
    now = state.spent[report.identity] = (int(tokens or 0), float(cost_usd or 0.0))
    state.tokens += now[0] - before[0]
    state.cost_usd += now[1] - before[1]


def _hopeless(state: _CampaignState, report: Report, store: Store) -> bool:
    """Whether a cell kills its workers: a cell that gets further each time was only unlucky."""
    before, count = state.losses.get(report.identity, (-1, 0))
    size = store.journal_size(report.identity)
    count = 1 if size > before else count + 1
    state.losses[report.identity] = (size, count)
    return count >= LOSSES


def _look_again(state: _CampaignState) -> None:
    """Cells of other processes go back in line: a worker that takes one finds it finished, free or still held."""
    now = time.monotonic()
    for identity, (when, cell) in list(state.elsewhere.items()):
        if now >= when:
            del state.elsewhere[identity]
            state.todo.append(cell)
