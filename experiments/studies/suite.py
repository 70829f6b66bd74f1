"""``bsa bench suite``: every method on every case, the paper's main table and its box plots."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...core.files import write_text
from ...core.scaffold import Scaffold
from ..suite.case import SuiteCase
from .cell import CellRecord
from .figures import box_plots, convergence
from .many import Say, make_cells, run_cells
from .table import METRICS, main_table, markdown, rows_of, write_csv, write_json


def suite_study(
    cases: Iterable[SuiteCase],
    out: Path,
    scaffolds: Sequence[str | Scaffold] = ("default", "random", "cma-es", "de", "bo"),
    simulations: int = 100,
    workers: int = 2,
    seed: int = 1234,
    backend: str = "rules",
    backend_options: dict[str, Any] | None = None,
    keep_runs: bool = False,
    say: Say = print,
    own_budgets: Mapping[str, int] | None = None,
) -> list[CellRecord]:
    """Fit every case by every method and write ``table.md``, ``cells.csv``, ``table.json`` and figures.

    Parameters
    ----------
    cases : iterable of SuiteCase
        From `load_suite` and `choose`.
    out : Path
        The study's folder; finished cells in it are not run again.
    scaffolds : sequence of str or Scaffold
        The methods.
    simulations : int
        Simulations a case at most.
    workers : int
        Cases side by side.
    seed : int
        Seed of every run.
    backend, backend_options
        Language model of the scaffolds that ask one.
    keep_runs : bool
        Whether journals and reports are kept.
    say : callable
        Takes a line of progress.
    own_budgets : mapping of str to int, optional
        Simulations for the cases of one parameter set, in place of ``simulations``.
    """
    cells = make_cells(cases, scaffolds, simulations, seed, backend, backend_options, own_budgets)
    records = run_cells(cells, out, workers, say, keep_runs)
    write_suite(records, out)
    say(f"Written to {out}: table.md, cells.csv, table.json, figures.")
    return records


def write_suite(records: Sequence[CellRecord], out: Path) -> None:
    """The table and figures of finished cells."""
    rows = rows_of(records)
    write_text(out / "table.md", "\n".join(markdown(rows, metric) for metric in METRICS))
    write_csv(out / "cells.csv", rows)
    summary = {
        metric: {
            mode: {method: {name: asdict(entry) for name, entry in row.items()} for method, row in methods.items()}
            for mode, methods in main_table(rows, metric).items()
        }
        for metric in METRICS
    }
    write_json(out / "table.json", summary)
    box_plots(records, lambda record: record.mode, out / "by_mode.png", "Error by mode")
    box_plots(records, lambda record: record.parameter_set, out / "by_set.png", "Error by base cell")
    box_plots(records, lambda record: record.rates, out / "by_rate.png", "Error by rate (charge/discharge)")
    convergence(records, out / "convergence.png")
