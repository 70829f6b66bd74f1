"""What a grid would take: runs, simulations, time, tokens and cost; learnt from finished cells where there are any."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ...backends.opening import on_own_machines
from ...core.contracts.registry import installed
from ...core.errors import BsaError
from ...core.run.budget import simulated
from ...core.run.journal import read_events
from ...core.run.run_config import RunConfig
from .calibration import Calibration
from .results import read_table
from .store import Store
from .summary import Row, grouped, mean_of

_KIND = ("mode", "chemistry", "scaffold", "backend")
_SPENT = ("wall_s", "tokens", "llm_calls")

_START_S = 12.0
"""Starting a simulator, compiling the model, two scores on the standard mesh; on a core of its own."""

_SIMULATION_S = {"ORegan2022": 5.6}
_USUAL_SIMULATION_S = 0.6
"""One simulation of a search: medians over the runs of ``docs/results/published.csv``."""

_CALL_TOKENS = 4500
"""Prompt and reply of one round: 12,600 and 800 characters on the full scaffold with nine parameters (means of 650
recorded calls), at three characters a token, for numbers make short tokens."""

_CALL_S = 10.0
"""A guess at one answer of a local model; finished cells replace it."""


@dataclass(frozen=True)
class Need:
    """What cells take."""

    # cells, simulations, calls: Runs; simulations at most; calls of a language model, about: a round may take none, or
    # several where the model asks before it acts, or its reply cannot be used.
    cells: int = 0
    simulations: int = 0
    calls: int = 0
    seconds: float = 0.0  # Time of all runs, one after the other.
    tokens: int = 0  # Prompt and reply together.
    cost_usd: float | None = 0.0  # None where nobody knows a price.
    learnt: bool = False  # Whether time and tokens come from finished cells rather than from a rule of thumb.

    def __add__(self, other: Need) -> Need:
        costs = (self.cost_usd, other.cost_usd)
        return Need(
            self.cells + other.cells,
            self.simulations + other.simulations,
            self.calls + other.calls,
            self.seconds + other.seconds,
            self.tokens + other.tokens,
            None if None in costs else sum(cost or 0.0 for cost in costs),
            other.learnt if self.cells == 0 else self.learnt and other.learnt,
        )


Experience = dict[tuple[str, str, str, str], list[Row]]
"""Rows of finished cells by mode, chemistry, scaffold and backend: a life takes far longer than two cycles."""


def experience(store: Store) -> Experience:
    """What finished cells of every campaign in the store took.

    Of a run that ended for its rounds the row says as ``rounds`` how many it was allowed, where its journal does.
    """
    tables = [read_table(path) for path in sorted(store.root.glob("grids/*/cells.csv"))]
    done = [row for table in tables for row in table if row.get("state") == "done"]
    return grouped([{**row, "rounds": _rounds_allowed(row, store)} for row in done], *_KIND)


def _rounds_allowed(row: Row, store: Store) -> int:
    """0 where it is not known, or ended nothing."""
    if row.get("status") == "rounds-spent":
        with suppress(BsaError):
            for event in read_events(store.cell(str(row["identity"]))):
                return int(event.get("config", {}).get("rounds", 0))
    return 0


def _scaled(row: Row, config: RunConfig) -> Row:
    """What a finished cell took, for another budget: as the simulations.

    One that spent its simulations, or its rounds, spends what it is allowed; one that ended before does so again.
    """
    made = expected = float(row["simulations"])
    if row.get("status") == "simulations-spent":
        expected = config.simulations
    elif row["rounds"]:
        expected *= config.rounds / row["rounds"]
    share = min(expected, config.simulations) / made if made > 0 else 1.0
    return {name: None if row[name] is None else share * row[name] for name in (*_SPENT, "cost_usd")}


def need_of(cell: Calibration, past: Experience) -> Need:
    """What one cell takes at most (simulations) and about (the rest), from its start.

    What finished cells took is scaled to its budget.
    """
    config = cell.config
    asks = installed().find("proposer", config.scaffold.proposer.use).entry.asks_model
    rounds = config.rounds + (1 if config.warm_up and config.scaffold.warm_up else 0)
    calls = rounds * int(cell.backend.options.get("votes") or 1) if asks else 0
    known = past.get((cell.task.mode, cell.task.chemistry, config.scaffold.name, cell.backend.use))
    if known is not None:
        known = [_scaled(row, config) for row in known]
        # Of what is not known nothing was spent, but of money: a price that is not known is none that is nothing.
        seconds, tokens, calls_made = (float(np.nan_to_num(mean_of(known, name))) for name in _SPENT)
        spent = mean_of(known, "cost_usd")
        cost = _cost(cell, round(tokens)) if math.isnan(spent) else spent
        return Need(1, config.simulations, round(calls_made), seconds, round(tokens), cost, True)
    simulation_s = _SIMULATION_S.get(cell.task.chemistry, _USUAL_SIMULATION_S)
    model_calls = calls if config.backend != "rules" else 0
    seconds = _START_S + simulation_s * config.simulations + _CALL_S * model_calls
    asked = _CALL_TOKENS * model_calls
    return Need(1, config.simulations, calls, seconds, asked, _cost(cell, asked))


def left_of(cell: Calibration, need: Need, store: Store) -> Need:
    """What is left of a cell's need where it was begun: time, calls and tokens as the simulations."""
    done = 0
    with suppress(BsaError):  # no journal, or a damaged one, which the run refuses
        done = simulated(read_events(store.cell(cell.identity))) if cell.identity else 0
    left = max(need.simulations - done, 0)
    share = left / need.simulations
    return replace(
        need,
        simulations=left,
        calls=round(share * need.calls),
        seconds=share * need.seconds,
        tokens=round(share * need.tokens),
        cost_usd=None if need.cost_usd is None else share * need.cost_usd,
    )


def _cost(cell: Calibration, tokens: int) -> float | None:
    if not tokens or on_own_machines(cell.backend.use, cell.backend.options):
        return 0.0
    price = cell.backend.usd_per_million_tokens
    return None if price is None else price * tokens / 1e6


def estimate(cells: Sequence[Calibration], store: Store) -> dict[str, Need]:
    """What is still to be done, by scaffold and backend, finished cells left out."""
    past = experience(store)
    needs: dict[str, Need] = {}
    for cell in cells:
        name = f"{cell.config.scaffold.name} · {cell.backend.use}"
        needs.setdefault(name, Need())
        if not (cell.identity and store.result(cell.identity)) and not cell.task.trouble:
            needs[name] = needs[name] + left_of(cell, need_of(cell, past), store)
    return needs
