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
    words: str  # What it holds, for the documentation.
    value: Callable[[Facts], Any]  # From what is known of a cell to the value.
    page: str = ""  # Its head on the page; empty for a column that is not shown there.
    page_scale: float = 1.0  # What the page multiplies its values by.
    error: str = ""  # What tables call it, where it is an error of a fit.
    effort: str = ""  # What the table of effort calls its mean; empty for a column that is not in it.


def _axis(name: str, words: str, page: str = "", kind: type[str] | type[int] = str) -> Column:
    return Column(name, kind, words, lambda facts: kind(facts.entry[name]), page)


def _metric(name: str, words: str, page: str = "", error: str = "", scale: float = 1.0) -> Column:
    return Column(name, float, words, lambda facts: facts.best_number(name), page, scale, error)


def _initial(name: str, page: str = "") -> Column:
    words = f"`{name}` of the starting point"
    return Column(f"initial_{name}", float, words, lambda facts: facts.number("initial", name), page)


def _told(
    name: str, words: str, kind: type[str] | type[int] | type[float] = float, page: str = "", effort: str = ""
) -> Column:
    return Column(name, kind, words, lambda facts: facts.result.get(name), page, effort=effort)


COLUMNS = (
    Column("grid", str, "name of the grid or study", lambda facts: facts.campaign),
    _axis("task", "name of the task; of a study its item", "Task"),
    _axis("mode", "`regular`, `extreme`, ... of a suite, `own` of any other task; of a study its name", "Mode"),
    _axis("chemistry", "PyBaMM's parameter set", "Chemistry"),
    _axis("rates", "C-rates of the task's records", "Rates"),
    _axis("method", "what tables call the row: the scaffold, with the backend where several were compared", "Method"),
    _axis("scaffold", "name of the scaffold"),
    _axis("backend", "the language model, as `--backend` names it"),
    _axis("seed", "seed of the run", "Seed", int),
    Column(
        "state",
        str,
        "`done`; `stopped` (begun, and ended by its allowance or a person: the same command goes on with it), "
        "`failed`, or `missing` where it has not run",
        lambda facts: facts.state,
        "State",
    ),
    Column(
        "status",
        str,
        "why a run ended, `status` of `result.json`; this and all that follows up to `cpu_s` only where it is `done`",
        lambda facts: facts.result.get("status", ""),
        "Ended",
    ),
    _metric(
        "objective",
        "what the search minimises, of the simulation with the least of it, as the errors that follow: `mape`, "
        "`v_rmse_mv` where the measured current drives the cell, or the RMS misfit in tolerances",
    ),
    _metric("mape", "total MAPE, %: the sum of the next three", "MAPE / %", "total MAPE, %"),
    _metric("q_mape", "error of the charge, %"),
    _metric("i_mape", "mean absolute error of the current, %"),
    _metric("v_mape", "mean absolute error of the voltage, %"),
    _metric("rmse", "sum of the RMS errors of charge (A h), current (A) and voltage (V)", "RMSE", "total RMSE"),
    _metric("v_rmse_mv", "RMS error of the voltage where both records exist, mV", "V RMSE / mV", "voltage RMSE, mV"),
    _metric("step_duration_error", "mean of abs(ln(simulated / measured duration)) over the steps"),
    _metric(
        "capacity_error", "relative error of the discharged capacity, as a fraction", "Capacity error / %", scale=100.0
    ),
    _metric("fade_error", "of a life: mean capacity error over all cycles, % of the first cycle's capacity"),
    _metric("resistance_error", "of a life: mean resistance error over the cycles whose resistance was measured, %"),
    _initial("objective"),
    _initial("mape", "MAPE before / %"),
    _initial("v_rmse_mv"),
    Column(
        "early_objective",
        float,
        f"least `objective` among the first {EARLY} simulations, as the search simulated them",
        lambda facts: facts.trace.best_after(EARLY),
    ),
    _told("simulations", "simulations of the search, warm-up and the first one included", int, "Sim.", "simulations"),
    _told("failed_simulations", "how many of them failed", int, "Failed", "of them failed"),
    _told("low_fidelity_simulations", "simulations by a low-fidelity model; not among the others", int),
    _told("llm_calls", "calls of the language model", int, effort="model calls"),
    Column(
        "lost_calls", int, "how many of them gave no reply; also of a cell that failed for it", lambda f: f.lost_calls
    ),
    _told("unusable_replies", "replies that could not be used: they broke the schema, or named what is not there", int),
    _told("lost_rounds", "rounds without a candidate, for that or for want of a reply", int),
    _told("tokens", "tokens of prompts and replies", int, "Tokens", "tokens"),
    _told("cost_usd", "price of these tokens, US dollars; empty where it is not known", float, "Cost / $", "cost / $"),
    _told("wall_s", "time from start to end, of each time it was taken up, s", float, "Time / s", "time / s"),
    _told("simulator_s", "time of all simulations, those side by side added up, s"),
    _told("low_fidelity_s", "time of those by a low-fidelity model, which is part of it, s"),
    _told("backend_s", "time of the language model, s"),
    Column(
        "proposer_s",
        float,
        "time of the method between simulations, the language model's left out, s; of a resumed run of its last part",
        lambda facts: facts.trace.proposer_s,
    ),
    Column(
        "resumed",
        str,
        "`yes` where the run was stopped and taken up again",
        lambda facts: "yes" if facts.trace.resumed else "",
    ),
    Column(
        "best_simulation",
        int,
        "number, from 0, of the simulation whose errors these are: that with the lowest score",
        lambda facts: best_score(facts.result).get("trial"),
    ),
    _told("verdict", "of a discovery: its verdict", str, "Verdict"),
    Column("named", str, "of a discovery: the effects named", lambda f: " + ".join(f.result.get("names", ())), "Named"),
    Column(
        "gap_closed",
        float,
        "of a discovery: share of the squared misfit beyond noise that is explained on fitted records",
        lambda facts: facts.number("gap", "closed"),
        "Gap closed",
    ),
    Column(
        "held_out_gap_closed",
        float,
        "the same on held-out records",
        lambda facts: facts.number("gap", "holdout_closed"),
        "Held-out gap closed",
    ),
    _told("cpu_s", "of a discovery: processor time of its process, s"),
    Column(
        "identity",
        str,
        "hash of what determines the result, and name of the folder under `cells/`; empty while its task is not made",
        lambda facts: facts.entry["identity"],
    ),
    Column("reason", str, "why there is no result", lambda facts: facts.reason, "Reason"),
)
