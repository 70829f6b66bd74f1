"""``bsa bench runtime``: where the time goes, with as many steps for every method."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...core.files import write_csv, write_text
from ..campaign.figures import round_times
from ..campaign.store import Store
from ..campaign.summary import Row
from ..campaign.text_tables import markdown_table
from ..campaign.trace import Trace
from .grids import trace_of

_ENDS = 5

_HEADS = {
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

_PAPER = (
    "Paper, Chen2020, 20 steps: agent 322.4 s in all, 13.85 s a round first five and 13.82 s last five;\n"
    "BO 541.0 s in all, 44.3 s a round first five and 477.3 s last five."
)


def write_runtime(rows: Sequence[Row], store: Store, out: Path) -> list[dict[str, Any]]:
    """Read the clock of methods that ran one after the other, alone, for the same number of simulations.

    Writes ``runtime.csv``, ``runtime.md`` and ``rounds.svg``. Of a cell that was taken up again there are no rounds:
    its times would mean nothing.
    """
    traces = {row["method"]: trace_of(row, store) for row in rows if row["state"] == "done"}
    timed = [runtime_row(row, traces[row["method"]]) for row in rows if row["method"] in traces]
    write_csv(out / "runtime.csv", timed)
    unknown = float("nan")
    lines = [[row["method"], *(f"{unknown if row[key] is None else row[key]:.4g}" for key in _HEADS)] for row in timed]
    write_text(out / "runtime.md", f"{markdown_table(['method', *_HEADS.values()], lines)}\n\n{_PAPER}\n")
    rounds = {method: trace.rounds for method, trace in traces.items() if trace.rounds}
    if rounds:
        whole = {method: [entry.round_s for entry in times] for method, times in rounds.items()}
        proposals = {method: [entry.proposer_s for entry in times] for method, times in rounds.items()}
        drawn = round_times({"whole round": whole, "proposer, model included": proposals})
        write_text(out / "rounds.svg", drawn)
    return timed


def runtime_row(row: Row, trace: Trace) -> dict[str, Any]:
    """Times of one method, in seconds; a round's time is shared among its simulations."""
    shared = [entry for entry in trace.rounds for _ in range(entry.simulations)]
    steps = [entry.round_s / entry.simulations for entry in shared]
    proposals = [entry.proposer_s / entry.simulations for entry in shared]
    times = {
        "first_steps_s": _mean(steps[:_ENDS]),
        "last_steps_s": _mean(steps[-_ENDS:]),
        "first_proposals_s": _mean(proposals[:_ENDS]),
        "last_proposals_s": _mean(proposals[-_ENDS:]),
    }
    return {name: times[name] if name in times else row[name] for name in ("method", *_HEADS)}


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None
