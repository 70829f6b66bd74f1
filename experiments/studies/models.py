"""``bsa bench models``: what a language model is worth, as one card that all models are measured by."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...core.files import write_csv, write_text
from ...core.proposal import unusable_replies
from ...core.run.journal import read_events
from ...core.scaffold import load_scaffold
from ..campaign.grid_file import BackendChoice, GridFile, Included, SuiteFilter
from ..campaign.results import check_grid_folder
from ..campaign.running import Plan
from ..campaign.store import Store
from ..campaign.study_cell import StudyCell
from ..campaign.summary import Row, geometric_mean, short
from ..campaign.text_tables import markdown_table
from ..discovery_bench.reports import Report, places, ranking_cell
from ..discovery_bench.shortlists import HOW
from .grids import budget, study_grid, trace_of, with_results

CASES = (
    *("regular-10", "regular-57", "regular-94", "extreme-106"),  # Chen2020
    *("regular-225", "regular-265", "extreme-447"),  # Ecker2015
    *("regular-342", "regular-376", "extreme-641"),  # Prada2013
    *("regular-448", "extreme-821"),  # Marquis2019
)
"""Tasks of the generated suite, chosen by their place in it: four base cells whose simulations are quick."""

SIMULATIONS = 20

_AMONG = (1, 3, 5)
"""Places that are counted; a ranking names five effects at most."""


def models_grid(
    cases: SuiteFilter,
    backend: BackendChoice,
    scaffold: str = "full",
    simulations: int = SIMULATIONS,
    seed: int = 1234,
    warm_up: int | None = None,
) -> GridFile:
    """Every case by the scaffold with the backend, and by what it is held against; see `study_grid`."""
    against = [Included(scaffolds=["hybrid"], backends=[BackendChoice(use="rules")])]
    if backend.use != "rules":
        against.append(Included(scaffolds=[scaffold], backends=[BackendChoice(use="rules")]))
    limits = budget(simulations) | ({} if warm_up is None else {"warm_up": warm_up})
    against = [one.model_copy(update=limits) for one in against]
    name = "models-" + re.sub(r"[^A-Za-z0-9]+", "-", backend.use)[:50]
    return study_grid(name, cases, [scaffold], backend, simulations, seed, include=against, warm_up=limits["warm_up"])


def plan_rankings(
    reports: Sequence[Report], backend: BackendChoice, seed: int, store: Path, folder: Path
) -> Plan[StudyCell]:
    """The rankings as a campaign beside that of the calibrations."""
    check_grid_folder(folder)
    cells = [ranking_cell(report, backend, seed) for report in reports]
    return Plan({"name": "rankings"}, cells, Store(store), folder)


def card(
    backend: str,
    scaffold: str,
    simulations: int,
    rows: Sequence[Row],
    rankings: Sequence[Row],
    reports: Sequence[Report],
    store: Store,
) -> dict[str, Any]:
    """A backend's card as a row, from the rows of `models_grid` and of its rankings; the scaffold may be a file."""
    done, name = with_results(rows), load_scaffold(scaffold).name
    own = _by_task(done, scaffold=name, backend=backend)
    rules = _by_task(done, scaffold=name, backend="rules")
    hybrid = _by_task(done, scaffold="hybrid", backend="rules")
    common = [task for task in own if task in rules and task in hybrid]
    traces = [trace_of(own[task], store) for task in common]
    told = {row["task"]: store.result(row["identity"]) or {} for row in rankings if row["state"] == "done"}
    spent = [*(own[task] for task in common), *(row for row in rankings if row["state"] == "done")]
    calls, lost = (sum(int(row[name] or 0) for row in spent) for name in ("llm_calls", "lost_calls"))
    replies = calls - lost
    unusable = sum(_unusable(store.cell(own[task]["identity"])) for task in common)
    unusable += sum(len(HOW) - int(result["replies"]) for result in told.values())
    ranked = [places(report, told[report.name]) for report in reports if report.name in told]
    error, with_rules, with_hybrid = (
        geometric_mean([found[t]["mape"] for t in common]) for found in (own, rules, hybrid)
    )
    return {
        "backend": backend,
        "simulations": simulations,  # Of a calibration at most.
        "tasks": len(common),
        # Geometric mean of the total MAPE in percent over the same tasks.
        "error_pct": error,
        "rules_pct": with_rules,
        "hybrid_pct": with_hybrid,
        "improved": sum(trace.improved for trace in traces),
        "calls": calls,  # In calibrations and rankings, those included that gave no reply.
        "valid_pct": 100.0 * (1.0 - unusable / replies) if replies else math.nan,
        # Of a call that gave a reply.
        "tokens_a_call": _sum(spent, "tokens") / replies if replies else math.nan,
        "seconds_a_call": _sum(spent, "backend_s") / replies if replies else math.nan,
        "cost_usd": math.nan if any(row["cost_usd"] is None for row in spent) else _sum(spent, "cost_usd"),
        "reports": len(ranked),
        # In how many of them the hidden effect is among the first places.
        **{f"{how}_{k}": sum(found[how] <= k for found in ranked) for how in HOW for k in _AMONG},
    }


def _by_task(rows: Sequence[Row], **wanted: str) -> dict[str, Row]:
    return {row["task"]: row for row in rows if all(row[name] == value for name, value in wanted.items())}


def _sum(rows: Sequence[Row], name: str) -> float:
    return float(sum(row[name] or 0.0 for row in rows))


def _unusable(folder: Path) -> int:
    """Replies of a calibration that did not pass the check."""
    return sum(unusable_replies(event["details"]) for event in read_events(folder) if event["event"] == "proposal")


def write_card(found: Row, out: Path) -> str:
    """``card.md`` and ``card.csv``; returns the first."""
    text = cards_table([found]) + "\n"
    write_text(out / "card.md", text)
    write_csv(out / "card.csv", [found])
    return text


def cards_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """A column a backend."""
    lines = [
        ["tasks", *(f"{row['tasks']:.0f}" for row in rows)],
        ["simulations a task", *(f"{row['simulations']:.0f}" for row in rows)],
        ["error / %", *(short(row["error_pct"]) for row in rows)],
        ["`rules` on the same tasks / %", *(short(row["rules_pct"]) for row in rows)],
        ["hybrid with `rules` / %", *(short(row["hybrid_pct"]) for row in rows)],
        ["better than its warm-up", *(f"{row['improved']:.0f} of {row['tasks']:.0f}" for row in rows)],
        ["calls", *(f"{row['calls']:.0f}" for row in rows)],
        ["valid replies", *(f"{row['valid_pct']:.0f} %" for row in rows)],
        ["tokens a call", *(f"{row['tokens_a_call']:.0f}" for row in rows)],
        ["seconds a call", *(short(row["seconds_a_call"]) for row in rows)],
        ["cost / $", *(short(row["cost_usd"]) for row in rows)],
        ["reports ranked", *(f"{row['reports']:.0f}" for row in rows)],
        *(
            [f"hidden effect first, among 3, among 5: {words}", *(_places(row, how) for row in rows)]
            for how, words in (("named", "with names"), ("nameless", "names without meaning"))
        ),
    ]
    return markdown_table(["", *(str(row["backend"]) for row in rows)], lines)


def _places(row: Mapping[str, Any], how: str) -> str:
    return ", ".join(f"{row[f'{how}_{k}']:.0f}" for k in _AMONG) if row["reports"] else "–"
