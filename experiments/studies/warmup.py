"""``bsa bench warmup``: perturbations that the model proposes, against random ones."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...core.files import write_csv, write_text
from ...core.scaffold import PluginChoice, Scaffold
from ..campaign.store import Store
from ..campaign.summary import Row, grouped
from ..campaign.text_tables import brief, markdown_table, spread
from .grids import trace_of, with_results

STRATEGIES = ("random", "proposed")

_KEPT = ("task", "method", "mape", "rmse", "simulations", "failed_simulations")


def with_warm_up(scaffold: Scaffold, strategy: str) -> Scaffold:
    """The scaffold with another warm-up, named after it."""
    return scaffold.model_copy(
        update={"name": f"{scaffold.name}+{strategy}-warm-up", "warm_up": PluginChoice(use=strategy)}
    )


def write_warmup(rows: Sequence[Row], store: Store, out: Path) -> list[dict[str, Any]]:
    """Compare the errors of one scaffold with different warm-ups, after the warm-up and at the end.

    Writes ``warmup.csv`` and ``warmup.md``.
    """
    found = [
        {**{name: row[name] for name in _KEPT}, "after_warm_up_mape": trace_of(row, store).best_before_search()}
        for row in with_results(rows)
    ]
    write_csv(out / "warmup.csv", found)
    write_text(out / "warmup.md", warm_up_table(found) + "\n")
    return found


def warm_up_table(rows: Sequence[Row]) -> str:
    """Errors after the warm-up and at the end, by kind of warm-up."""
    cases = list(dict.fromkeys(row["task"] for row in rows))
    lines = []
    for method, found in grouped(rows, "method").items():
        own = {row["task"]: row for row in found}
        both = [spread([row[name] for row in own.values()]) for name in ("after_warm_up_mape", "mape")]
        lines.append(
            [method.partition("+")[2], *both, *(brief(own[case]["mape"]) if case in own else "–" for case in cases)]
        )
    return markdown_table(["MAPE / %", "best after it", "at the end", *cases], lines)
