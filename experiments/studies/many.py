"""Many cells, side by side, resumable, with an estimate of the time left."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from itertools import product
from pathlib import Path
from typing import Any

from ...core.errors import BsaError, did_you_mean
from ...core.parentage import end_with_parent
from ...core.scaffold import Scaffold
from ..suite.case import SuiteCase
from .cell import CellRecord, StudyCell, finished, run_cell, study_config

Say = Callable[[str], None]

_START_S = 7.0
"""Importing PyBaMM, making the target, compiling, scoring."""

_SLOW_SETS = {"ORegan2022": (4.5, 60.0)}
"""Seconds for one simulation and for making the target and scoring, where the default is far off."""

_SIMULATION_S = 0.4
_PROPOSAL_S = {"bo": 1.5, "qnehvi": 6.0}

_DEATHS = 3
"""Deaths of a process in a row, with no cell finished between them, before a study gives up."""


def make_cells(
    cases: Iterable[SuiteCase],
    scaffolds: Sequence[str | Scaffold],
    simulations: int,
    seed: int,
    backend: str = "rules",
    backend_options: dict[str, Any] | None = None,
    own_budgets: Mapping[str, int] | None = None,
) -> list[StudyCell]:
    """Every case with every method, case by case, so that a study cut short has whole rows.

    Cases of a parameter set that ``own_budgets`` names have that many simulations in place of ``simulations``.

    Raises
    ------
    BsaError
        If no case is of a set that it names.
    """
    cases, budgets = list(cases), own_budgets or {}
    sets = {case.parameter_set for case in cases}
    for name in budgets:
        if name not in sets:
            raise BsaError(
                f'no case is of the base cell "{name}", which has a budget of its own.',
                did_you_mean(name, sets) or f"base cells of these cases: {', '.join(sorted(sets))}.",
            )
    return [
        StudyCell(
            case,
            scaffold if isinstance(scaffold, str) else scaffold.name,
            study_config(scaffold, budgets.get(case.parameter_set, simulations), seed, backend, backend_options or {}),
        )
        for case, scaffold in product(cases, scaffolds)
    ]


def run_cells(
    cells: Sequence[StudyCell], out: Path, workers: int = 1, say: Say = print, keep_runs: bool = False
) -> list[CellRecord]:
    """Run what is not finished yet.

    Parameters
    ----------
    cells : sequence of StudyCell
        The cells.
    out : Path
        The study's folder.
    workers : int
        Cells side by side, each with one simulator process.
    say : callable
        Takes a line of progress.
    keep_runs : bool
        Whether journals and reports are kept.

    Returns
    -------
    list of CellRecord
        In the order of the cells.
    """
    records = {cell.identity: record for cell in cells if (record := finished(cell, out)) is not None}
    todo = [cell for cell in cells if cell.identity not in records]
    progress = _Progress(todo, workers, say)
    if records:
        say(f"{len(records)} of {len(cells)} cells are finished already.")
    for cell, record in _results(todo, out, workers, keep_runs):
        records[cell.identity] = record
        progress.done(cell, record)
    return [records[cell.identity] for cell in cells]


def _results(
    cells: Sequence[StudyCell], out: Path, workers: int, keep_runs: bool
) -> Iterator[tuple[StudyCell, CellRecord]]:
    if workers <= 1 or len(cells) <= 1:
        for cell in cells:
            yield cell, run_cell(cell, out, 1, keep_runs)
        return
    # One thread each: the parallelism is in the processes.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    deaths = 0
    while cells:
        done: set[str] = set()
        try:
            for cell, record in _pooled(cells, out, workers, keep_runs):
                done.add(cell.identity)
                yield cell, record
        except BrokenProcessPool:
            # Killed from outside or out of memory. The cells it held resume from their journals.
            deaths = 1 if done else deaths + 1
            if deaths >= _DEATHS:
                raise BsaError(
                    f"processes of the study died {deaths} times in a row without finishing a cell.",
                    "give it more memory or fewer --workers; finished cells are kept.",
                ) from None
        cells = [cell for cell in cells if cell.identity not in done]


def _pooled(
    cells: Sequence[StudyCell], out: Path, workers: int, keep_runs: bool
) -> Iterator[tuple[StudyCell, CellRecord]]:
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=end_with_parent)
    try:
        waiting: dict[Future[CellRecord], StudyCell] = {
            pool.submit(run_cell, cell, out, 1, keep_runs): cell for cell in cells
        }
        for future in as_completed(waiting):
            yield waiting[future], future.result()
    finally:
        # After an interrupt the running cells stop by themselves: the signal reaches them too.
        pool.shutdown(wait=True, cancel_futures=True)


def estimate_s(cell: StudyCell) -> float:
    """A first guess at the time a cell takes, s."""
    simulation_s, start_s = _SLOW_SETS.get(cell.case.parameter_set, (_SIMULATION_S, _START_S))
    count = 1 if cell.method == "default" else cell.config.simulations
    per_cycle = cell.case.cycles / 2
    return start_s + count * (simulation_s * per_cycle + _PROPOSAL_S.get(cell.method, 0.02))


class _Progress:
    """Says what is done and how long the rest takes, learning from the pace so far."""

    def __init__(self, cells: Sequence[StudyCell], workers: int, say: Say) -> None:
        self._say = say
        self._count, self._done = len(cells), 0
        self._left_s = sum(estimate_s(cell) for cell in cells)
        self._past_s = 0.0
        self._started = time.monotonic()
        if cells:
            say(
                f"{len(cells)} cells to run, {workers} at a time: about {_words(self._left_s / max(workers, 1))}. "
                "Stop with Ctrl-C at any time; the same command goes on from there."
            )

    def done(self, cell: StudyCell, record: CellRecord) -> None:
        self._done += 1
        guess = estimate_s(cell)
        self._past_s += guess
        self._left_s -= guess
        pace = (time.monotonic() - self._started) / self._past_s
        score = "no result" if record.best is None else f"{record.best['mape']:.3g} % MAPE"
        self._say(
            f"[{self._done}/{self._count}] {record.case} {record.parameter_set} {record.rates} {record.method}: "
            f"{score}, {record.simulations} simulations, {record.wall_s:.0f} s. "
            f"About {_words(self._left_s * pace)} left."
        )


def _words(seconds: float) -> str:
    if seconds < 90:
        return f"{max(seconds, 0.0):.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
