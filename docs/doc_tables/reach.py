"""What the package reaches, in the few lines of the README."""

from collections import Counter

import numpy as np
from bsa.experiments.campaign.columns import EARLY
from bsa.experiments.campaign.summary import exact_interval, statistic
from bsa.experiments.campaign.text_tables import brief

from .by_cell import ROLES, errors_of, first_fits, of_role
from .discovery import BLIND, graded, in_measured
from .published import SLOW, below_the_paper, longer_tasks
from .results import Results


def reach(results: Results) -> str:
    """Measured cells, published tasks and blind records, each in a sentence or two."""
    return "\n".join(part(results) for part in (_measured, _published, _blind, _hidden))


def _measured(results: Results) -> str:
    rows = first_fits(results)
    cells = len({row["cell"] for row in rows})
    words = {
        "fitted": "that were fitted",
        "held out": "held out of these fits (some were in view while the method was developed)",
    }
    records = {role: of_role(rows, role) for role in ROLES}
    parts = [f"the {len(own)} records {words[role]}: {errors_of(own)}" for role, own in records.items()]
    return (
        f"* On {cells} measured cells of public data sets, started from literature sets, voltage under the measured "
        f"current; {'; '.join(parts)}. Cell by cell, with what is still wrong: "
        "[docs/real-cells-results.md](docs/real-cells-results.md)."
    )


def _published(results: Results) -> str:
    rows = results.rows("published")
    quick, slow = ([row for row in rows if (row["chemistry"] == SLOW) == is_slow] for is_slow in (False, True))
    below, cells = below_the_paper(rows)
    found, early = statistic([row["mape"] for row in quick]), statistic([row["early_objective"] for row in quick])
    errors = [row["mape"] for row in slow]
    longer = longer_tasks(rows)
    more = f" ({', '.join(row['task'] for row in longer)} had more)" if longer else ""
    return (
        f"* On the paper's {len(rows)} published tasks: below the best row of its table, agents and Bayesian "
        f"optimisation alike, in **{below} of the {cells} cells** (mode x chemistry). Four chemistries: mean total "
        f"MAPE **{brief(found.mean)} %** (worst {brief(found.worst)} %) in at most 100 simulations, "
        f"{brief(early.mean)} % after {EARLY}. The fifth, {SLOW}, whose simulations are slow: "
        f"{brief(float(np.mean(errors)))} % (median {brief(float(np.median(errors)))} %, worst "
        f"{brief(max(errors))} %) in 50{more}."
    )


def _blind(results: Results) -> str:
    cases = graded(results, BLIND)
    grades = Counter(case.grade for case in cases)
    seeds = len({case.task.split()[0] for case in cases})
    return (
        f"* On {len(cases)} cases of {seeds} fresh seeds, which draw the hidden effect, its strength, the cell and the "
        f"tests, each run once: the verdict is right in {grades['right']}, several names with the hidden one among "
        f"them are given in {grades['ambiguous']}, one of two effects is named in {grades['partial']}, none in "
        f"{grades['declined']}, and a **wrong one in {grades['wrong']}** "
        f"({exact_interval(grades['wrong'], len(cases))}): a name is a lead to be tested: "
        "[docs/discovery-results.md](docs/discovery-results.md)."
    )


def _hidden(results: Results) -> str:
    hiding = [(beside, case) for _, beside, case in in_measured(results) if beside and case.setting != "none"]
    told = []
    for words, several in (("one earlier record of the same test", False), ("two", True)):
        cases = [case for beside, case in hiding if (" and " in beside) is several]
        grades = Counter(case.grade for case in cases)
        told.append(
            f"Beside {words} ({len(cases)} cases) the right name is given in {grades['right']}, several names in "
            f"{grades['ambiguous']}, one of two effects in {grades['partial']}, none in {grades['declined']}, a wrong "
            f"one in {grades['wrong']} ({exact_interval(grades['wrong'], len(cases))})."
        )
    return (
        f"* In measured records a seed hid an effect of a strength that it drew. {' '.join(told)} What is found and "
        "what is not: [docs/discovery-results.md](docs/discovery-results.md#effects-hidden-in-measured-records)."
    )
