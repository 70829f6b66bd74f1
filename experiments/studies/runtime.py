"""``bsa bench runtime``: where the time goes, with as many steps for every method."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...core.files import write_text
from ...core.scaffold import Scaffold
from ..suite.case import SuiteCase
from .cell import CellRecord, run_cell
from .figures import round_times
from .many import Say, make_cells
from .table import write_csv, write_json

_ENDS = 5


def runtime_study(
    case: SuiteCase,
    out: Path,
    scaffolds: Sequence[str | Scaffold] = ("full", "bo"),
    steps: int = 20,
    seed: int = 1234,
    backend: str = "rules",
    backend_options: dict[str, Any] | None = None,
    say: Say = print,
) -> list[dict[str, Any]]:
    """Run methods one after the other, alone, for the same number of simulations, and read the clock.

    Writes ``runtime.csv``, ``runtime.json``, ``runtime.md`` and a figure. A cell that was interrupted is run
    again from its start when the folder of its run is removed; resumed times would mean nothing.

    Parameters
    ----------
    case : SuiteCase
        The case; the paper takes one of Chen2020.
    out : Path
        The study's folder.
    scaffolds : sequence of str or Scaffold
        The methods.
    steps : int
        Simulations after the initial one.
    seed, backend, backend_options, say
        As in `suite_study`.
    """
    records: list[CellRecord] = []
    for cell in make_cells([case], scaffolds, steps + 1, seed, backend, backend_options):
        say(f"{cell.method}: {steps} steps on {case.key} ...")
        records.append(run_cell(cell, out))
    rows = [runtime_row(record) for record in records]
    write_csv(out / "runtime.csv", rows)
    write_json(out / "runtime.json", {"rows": rows, "rounds": {r.method: [vars(t) for t in r.rounds] for r in records}})
    write_text(out / "runtime.md", _markdown(rows))
    round_times(records, out / "runtime.png")
    return rows


def runtime_row(record: CellRecord) -> dict[str, Any]:
    """Times of one method, in seconds; a round's time is shared among its simulations."""
    per_step = [time.round_s / max(time.simulations, 1) for time in record.rounds for _ in range(time.simulations)]
    proposer = [time.proposer_s / max(time.simulations, 1) for time in record.rounds for _ in range(time.simulations)]

    def mean(values: list[float]) -> float:
        return float(np.mean(values)) if values else float("nan")

    return {
        "method": record.method,
        "simulations": record.simulations,
        "llm_calls": record.llm_calls,
        "simulator_s": record.simulator_s,
        "backend_s": record.backend_s,
        "proposer_s": record.proposer_s,
        "wall_s": record.wall_s,
        "first_steps_s": mean(per_step[:_ENDS]),
        "last_steps_s": mean(per_step[-_ENDS:]),
        "first_proposals_s": mean(proposer[:_ENDS]),
        "last_proposals_s": mean(proposer[-_ENDS:]),
        "mape": record.metric("mape"),
    }


def _markdown(rows: Sequence[dict[str, Any]]) -> str:
    heads = {
        "simulations": "simulations",
        "llm_calls": "model calls",
        "simulator_s": "simulator / s",
        "backend_s": "model / s",
        "proposer_s": "proposer / s",
        "wall_s": "wall / s",
        "first_steps_s": f"step, first {_ENDS} / s",
        "last_steps_s": f"step, last {_ENDS} / s",
        "first_proposals_s": f"proposal, first {_ENDS} / s",
        "last_proposals_s": f"proposal, last {_ENDS} / s",
        "mape": "MAPE / %",
    }
    lines = ["| method | " + " | ".join(heads.values()) + " |", "|" + " --- |" * (len(heads) + 1)]
    for row in rows:
        lines.append(f"| {row['method']} | " + " | ".join(f"{row[key]:.4g}" for key in heads) + " |")
    lines += ["", "Paper, Chen2020, 20 steps: agent 322.4 s in all, 13.85 s a round first five and 13.82 s last five;"]
    lines += ["BO 541.0 s in all, 44.3 s a round first five and 477.3 s last five."]
    return "\n".join(lines) + "\n"
