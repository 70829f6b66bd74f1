"""Grids of the studies: cases of a suite with every method, all to the same budget of simulations."""

from collections.abc import Mapping, Sequence
from typing import Any

from ...core.errors import unknown
from ...core.scaffold import Scaffold
from ..campaign.grid_file import BackendChoice, GridFile, Included, SuiteFilter, TaskChoice
from ..campaign.store import Store
from ..campaign.summary import Row, grouped
from ..campaign.task_sources import suite_cases
from ..campaign.trace import Trace, read_trace


def budget(simulations: int) -> dict[str, int]:
    """A budget in simulations; a fifth goes to the warm-up where a scaffold has one (the paper's 20 of 100)."""
    return {"rounds": simulations, "warm_up": simulations // 5, "simulations": simulations}


def study_grid(
    name: str,
    cases: SuiteFilter,
    scaffolds: Sequence[str | Scaffold],
    backend: BackendChoice,
    simulations: int = 100,
    seed: int = 1234,
    own_budgets: Mapping[str, int] | None = None,
    **more: Any,
) -> GridFile:
    """Every case with every method.

    ``backend`` is that of the scaffolds that ask one; ``own_budgets`` are simulations for the cases of one base cell,
    in place of ``simulations``. Raises `BsaError` if no case is of a base cell with a budget of its own.
    """
    tasks: list[TaskChoice] = [cases]
    included: list[Included] = []
    if own_budgets:
        by_set = grouped(suite_cases(cases).values(), "parameter_set")
        of_set = {base: [case.key for case in found] for base, found in by_set.items()}
        included = [
            Included(tasks=[_only(cases, _keys(of_set, own))], **budget(count)) for own, count in own_budgets.items()
        ]
        tasks = [_only(cases, keys) for base, keys in of_set.items() if base not in own_budgets]
    if not tasks:
        (first, *included) = included
        tasks, simulations = first.tasks or [], first.simulations or simulations
    content = {"backends": [backend], "seeds": [seed], "include": included} | budget(simulations) | more
    return GridFile(name=name, tasks=tasks, scaffolds=list(scaffolds), **content)


def _only(cases: SuiteFilter, keys: list[str]) -> SuiteFilter:
    return cases.model_copy(update={"cases": keys})


def _keys(of_set: Mapping[str, list[str]], base: str) -> list[str]:
    if base not in of_set:
        message = f'no case is of the base cell "{base}", which has a budget of its own.'
        raise unknown(message, base, sorted(of_set), "base cells of these cases: {}.")
    return of_set[base]


def trace_of(row: Row, store: Store) -> Trace:
    """The simulations and rounds of a row's cell."""
    return read_trace(store.cell(row["identity"]))


def with_results(rows: Sequence[Row]) -> list[Row]:
    """The rows of cells that came to their end with something to compare."""
    return [row for row in rows if row["state"] == "done" and row["mape"] is not None]
