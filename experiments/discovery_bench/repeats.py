"""How well the tests of a cell repeat: records in which nothing has changed, beside the ones before."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...core.errors import BsaError
from ...core.inference.reference import check_tests, lacking, less
from ...core.rms import rms
from ..campaign.summary import Row, grouped
from ..campaign.text_tables import markdown_table
from ..discovery_case import DiscoverOptions, read_case
from ..discovery_setup import set_up

MOST = 4
"""References of a record at most."""


def repeats(options: DiscoverOptions) -> list[dict[str, Any]]:
    """Each record beside one to four before it; the options are those of a discovery on these records in their order.

    Raises `BsaError` if there is one record alone, they are not of one test, or cannot be simulated.
    """
    if len(options.data) < 2:
        raise BsaError("one record repeats nothing.", "give records of one test, in the order of their dates.")
    setup = set_up(read_case(options), options)
    seen = setup.problem.observations
    check_tests(seen[:1], seen)
    found = lacking(setup.simulator, seen[:1], seen, setup.space.at(np.zeros(len(setup.space))))
    rows = []
    for references in range(1, MOST + 1):
        for place in range(references, len(found)):
            observed, error = found[place]
            left = less(replace(observed, voltage=error), found[place - references : place])
            rows.append(
                {
                    "record": observed.name,
                    "references": references,
                    # What the base model lacks of the record, and that less what it lacks of the references.
                    "known_mv": 1e3 * rms(error),
                    "left_mv": 1e3 * rms(left.voltage),
                    "ratio": rms(left.voltage / left.sigma),  # Over what is taken to be uncertain.
                }
            )
    return rows


def repeats_table(rows: Sequence[Row]) -> str:
    """Markdown: by the number of references, what is left, and over what is taken to be uncertain."""
    lines = []
    for references, some in grouped(rows, "references").items():
        known, left = (np.median([row[name] for row in some]) for name in ("known_mv", "left_mv"))
        ratios = np.percentile([row["ratio"] for row in some], [50, 90, 100])
        numbers = [f"{known:.1f}", f"{left:.1f}", *(f"{ratio:.2f}" for ratio in ratios)]
        lines.append([f"{references:.0f}", str(len(some)), *numbers])
    over = ["over the uncertain: median", "90 % of the records", "largest"]
    return markdown_table(["references", "records", "the model lacks / mV", "left / mV", *over], lines, 0)
