"""Every column of the results table, each declared once: its type, its value, and where it is shown."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from .store import best_score
from .trace import Trace, read_trace

EARLY = 20
"""Simulations after which a method is looked at early, as the paper's runtime study does."""


@dataclass(frozen=True)
class Facts:
    """What is known of a cell when its row is written."""

    campaign: str  # Name of the campaign.
    entry: Mapping[str, Any]  # Of the manifest: axes, method and identity.
    # state, reason: What became of the cell, and why it has no result.
    state: str
    reason: str
    folder: Path  # The cell's.
    result: Mapping[str, Any]  # Of ``result.json``; empty for a cell that is not done.
    lost_calls: int | None = None  # Calls of the model without a reply, told of cells that failed for it, too.

    @cached_property
    def trace(self) -> Trace:
        """Its simulations; none of a cell that is not done."""
        return read_trace(self.folder) if self.result else Trace()

    def number(self, part: str, name: str) -> float | None:
        """A number of a part of the result; None where there is none, or none that is finite."""
        return _finite((self.result.get(part) or {}).get(name))

    def best_number(self, name: str) -> float | None:
        """An error of the simulation with the best score; None where there is none, or none that is finite."""
        return _finite(best_score(self.result).get(name))


def _finite(value: Any) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


@dataclass(frozen=True)
class Column:
    """One column of ``cells.csv``, ``cells.parquet`` and the page."""

    name: str  # Its head in the files.
    kind: type[str] | type[int] | type[float]  # Type of its values; None stands for what is not known.
    value: Callable[[Facts], Any]  # From what is known of a cell to the value.
    page: str = ""  # Its head on the page; empty for a column that is not shown there.
    error: str = ""  # What tables call it, where it is an error of a fit.
    effort: str = ""  # What the table of effort calls its mean; empty for a column that is not in it.


def _axis(name: str, page: str = "", kind: type[str] | type[int] = str) -> Column:
    return Column(name, kind, lambda facts: kind(facts.entry[name]), page)


def _metric(name: str, page: str = "", error: str = "") -> Column:
    return Column(name, float, lambda facts: facts.best_number(name), page, error)


def _initial(name: str, page: str = "") -> Column:
    return Column(f"initial_{name}", float, lambda facts: facts.number("initial", name), page)


def _told(name: str, kind: type[str] | type[int] | type[float] = float, page: str = "", effort: str = "") -> Column:
    return Column(name, kind, lambda facts: facts.result.get(name), page, effort=effort)


COLUMNS = (
    Column("grid", str, lambda facts: facts.campaign),
    _axis("task", "Task"),
    _axis("mode", "Mode"),
    _axis("chemistry", "Chemistry"),
    _axis("rates", "Rates"),
    _axis("method", "Method"),
    _axis("scaffold"),
    _axis("backend"),
    _axis("seed", "Seed", int),
    Column("state", str, lambda facts: facts.state, "State"),
    Column("status", str, lambda facts: facts.result.get("status", ""), "Ended"),
    _metric("objective"),
    _metric("mape", "MAPE / %", "total MAPE, %"),
    _metric("q_mape"),
    _metric("i_mape"),
    _metric("v_mape"),
    _metric("rmse", "RMSE", "total RMSE"),
    _metric("v_rmse_mv", "V RMSE / mV", "voltage RMSE, mV"),
    _metric("step_duration_error"),
    _metric("capacity_error", "Capacity error"),
    _metric("fade_error"),
    _metric("resistance_error"),
    _initial("objective"),
    _initial("mape", "MAPE before / %"),
    _initial("v_rmse_mv"),
    Column("early_objective", float, lambda facts: facts.trace.best_after(EARLY)),
    _told("simulations", int, "Sim.", "simulations"),
    _told("failed_simulations", int, "Failed", "of them failed"),
    _told("llm_calls", int, effort="model calls"),
    Column("lost_calls", int, lambda facts: facts.lost_calls),
    _told("tokens", int, "Tokens", "tokens"),
    _told("cost_usd", float, "Cost / $", "cost / $"),
    _told("wall_s", float, "Time / s", "time / s"),
    _told("simulator_s"),
    _told("backend_s"),
    Column("proposer_s", float, lambda facts: facts.trace.proposer_s),
    Column("resumed", str, lambda facts: "yes" if facts.trace.resumed else ""),
    Column("best_simulation", int, lambda facts: best_score(facts.result).get("trial")),
    _told("verdict", str, "Verdict"),
    Column("named", str, lambda facts: " + ".join(facts.result.get("names", ())), "Named"),
    Column("gap_closed", float, lambda facts: facts.number("gap", "closed"), "Gap closed"),
    Column("held_out_gap_closed", float, lambda facts: facts.number("gap", "holdout_closed"), "Held-out gap closed"),
    _told("cpu_s"),
    Column("identity", str, lambda facts: facts.entry["identity"]),
    Column("reason", str, lambda facts: facts.reason, "Reason"),
)
