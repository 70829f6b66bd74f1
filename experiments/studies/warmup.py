"""``bsa bench warmup``: perturbations that the model proposes, against random ones."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ...core.files import write_text
from ...core.scaffold import PluginChoice, Scaffold, load_scaffold
from ..suite.case import SuiteCase
from .cell import CellRecord
from .figures import box_plots
from .many import Say, make_cells, run_cells
from .table import statistic, write_csv, write_json

STRATEGIES = ("random", "proposed")


def warmup_study(
    cases: Iterable[SuiteCase],
    out: Path,
    scaffold: str = "full",
    strategies: Sequence[str] = STRATEGIES,
    simulations: int = 100,
    workers: int = 2,
    seed: int = 1234,
    backend: str = "rules",
    backend_options: dict[str, Any] | None = None,
    say: Say = print,
) -> list[dict[str, Any]]:
    """Run one scaffold with each warm-up strategy and compare the errors after the warm-up and at the end.

    Writes ``warmup.csv``, ``warmup.json``, ``warmup.md`` and two figures.

    Parameters
    ----------
    cases : iterable of SuiteCase
        From `choose`.
    out : Path
        The study's folder.
    scaffold : str
        The scaffold whose warm-up is exchanged.
    strategies : sequence of str
        Warm-up plugins.
    simulations, workers, seed, backend, backend_options, say
        As in `suite_study`.
    """
    scaffolds = [with_warm_up(load_scaffold(scaffold), strategy) for strategy in strategies]
    records = run_cells(make_cells(cases, scaffolds, simulations, seed, backend, backend_options), out, workers, say)
    rows = [_row(record) for record in records]
    write_csv(out / "warmup.csv", rows)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    names = ("after_warm_up_mape", "mape", "rmse")
    summary = {
        method: {name: vars(statistic([row[name] for row in rows if row["method"] == method])) for name in names}
        for method in methods
    }
    write_json(out / "warmup.json", summary)
    lines = ["| warm-up | best after it, MAPE / % | at the end, MAPE / % | RMSE |", "|" + " --- |" * 4]
    for method in methods:
        entries = [str(statistic([row[name] for row in rows if row["method"] == method])) for name in names]
        lines.append(f"| {method} | " + " | ".join(entries) + " |")
    write_text(out / "warmup.md", "\n".join(lines) + "\n")
    box_plots(records, lambda record: "MAPE", out / "warmup_mape.png", "Warm-up strategies")
    box_plots(
        records,
        lambda record: "RMSE",
        out / "warmup_rmse.png",
        "Warm-up strategies",
        lambda record: record.metric("rmse"),
        "total RMSE",
    )
    return rows


def with_warm_up(scaffold: Scaffold, strategy: str) -> Scaffold:
    """The scaffold with another warm-up, named after it."""
    return scaffold.model_copy(
        update={"name": f"{scaffold.name}+{strategy}-warm-up", "warm_up": PluginChoice(use=strategy)}
    )


def _row(record: CellRecord) -> dict[str, Any]:
    before = [t.mape for t in record.trials if t.phase != "search" and t.mape is not None]
    return {
        "case": record.case,
        "method": record.method,
        "after_warm_up_mape": min(before, default=math.nan),
        "mape": record.metric("mape"),
        "rmse": record.metric("rmse"),
        "simulations": record.simulations,
        "failed_simulations": record.failed_simulations,
    }
