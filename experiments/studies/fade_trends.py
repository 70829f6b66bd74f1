"""``bsa bench fade-trends``: fades of measured lives, continued without a cell.

What the first cycles alone tell of a later capacity: a square root of the cycle number, as of SEI growth limited by
diffusion, a straight line, and both together are fitted to the capacities of CALCE's cells, and continued.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...core.trajectory import FloatArray
from ..campaign.summary import Row, grouped
from ..campaign.text_tables import markdown_table
from .whole_life import FITTED, task_of_life

FITTED_TO = (FITTED, 300)

LAWS: Mapping[str, tuple[Callable[[FloatArray], FloatArray], ...]] = {
    "square root": (np.sqrt,),
    "line": (np.asarray,),
    "both": (np.sqrt, np.asarray),
}
"""What the capacity that is lost is a sum of, by the name of the law."""


def continued(cycle: FloatArray, capacity_ah: FloatArray, law: str, fitted_to: int) -> tuple[FloatArray, float]:
    """The capacities of all cycles by a law fitted to the first, A.h, and the root mean square of what it leaves, A.h.

    ``cycle`` and ``capacity_ah``, of shape (n,), are what was measured; ``law`` is one of `LAWS`, and ``fitted_to`` the
    last cycle of the fit.
    """
    columns = np.column_stack([np.ones(len(cycle)), *(part(cycle) for part in LAWS[law])])
    early = cycle <= fitted_to
    coefficients, *_ = np.linalg.lstsq(columns[early], capacity_ah[early], rcond=None)
    whole = columns @ coefficients
    return whole, float(np.sqrt(np.mean((whole - capacity_ah)[early] ** 2)))


def trends_of(cell: str, cycle: FloatArray, capacity_ah: FloatArray) -> Iterator[dict[str, Any]]:
    """Every law, from every last cycle of the fit, at the last cycle of a life."""
    for fitted_to in FITTED_TO:
        for law in LAWS:
            whole, left = continued(cycle, capacity_ah, law, fitted_to)
            yield {
                "cell": cell,
                "law": law,
                "fitted_to": fitted_to,
                "rms_pct": 100.0 * left / capacity_ah[0],  # What it leaves of the fitted capacities.
                "cycle": int(cycle[-1]),
                "off_pct": 100.0 * (whole[-1] / capacity_ah[-1] - 1.0),
            }


def continue_life(folder: Path, cell: str, record: Path) -> dict[str, Any]:
    """The trends of one life, as rows."""
    task = task_of_life(record)
    tables = [e.target.cycle_table for e in (*task.experiments, *task.held_out)]
    known = [table for table in tables if table is not None]
    life = (np.concatenate([getattr(table, name) for table in known]) for name in ("cycle", "capacity_ah"))
    rows = list(trends_of(cell, *life))
    return {"rows": rows, "summary": f"{len(rows)} trends"}


def trends_table(rows: Sequence[Row]) -> str:
    """What each law leaves of the cycles that it was fitted to, and comes to at the last cycle."""
    by_law = grouped(rows, "cell", "law")
    heads = [
        words
        for row in next(iter(by_law.values()))
        for words in (f"left of {row['fitted_to']:.0f} cycles", f"off at {row['cycle']:.0f}")
    ]
    lines = [
        [*law, *(text for row in own for text in (f"{row['rms_pct']:.2f} %", f"{row['off_pct']:+.1f} %"))]
        for law, own in by_law.items()
    ]
    return markdown_table(["cell", "law", *heads], lines, 2)
