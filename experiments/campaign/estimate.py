"""What a grid would take: runs, simulations, time, tokens and cost; learnt from finished cells where there are any."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass

from ...backends.opening import on_own_machines
from ...core.run_config import RunConfig
from .calibration import Calibration
from .store import Store

_START_S = 12.0
"""Starting a simulator, compiling the model, two scores on the standard mesh; on a core of its own."""

_SIMULATION_S = {"ORegan2022": 4.5}
_USUAL_SIMULATION_S = 0.4

_CALL_TOKENS = 4500
"""Prompt and reply of one round: 12,600 and 800 characters on the full scaffold with nine parameters (means of 650
recorded calls), at three characters a token, for numbers make short tokens."""

_CALL_S = 10.0
"""A guess at one answer of a local model; finished cells replace it."""


@dataclass(frozen=True)
class Need:
    """What cells take.

    Attributes
    ----------
    cells, simulations, calls : int
        Runs; simulations and calls of a language model at most.
    seconds : float
        Time of all runs, one after the other.
    tokens : int
        Prompt and reply together.
    cost_usd : float or None
        None where nobody knows a price.
    learnt : bool
        Whether time and tokens come from finished cells rather than from a rule of thumb.
    """

    cells: int = 0
    simulations: int = 0
    calls: int = 0
    seconds: float = 0.0
    tokens: int = 0
    cost_usd: float | None = 0.0
    learnt: bool = False

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


@dataclass
class _Experience:
    """Sums over finished cells of one kind."""

    cells: int = 0
    seconds: float = 0.0
    tokens: float = 0.0
    cost_usd: float = 0.0


Experience = dict[tuple[str, str, str], _Experience]


def experience(store: Store) -> Experience:
    """What finished cells of every grid in the store took, by chemistry, scaffold and backend."""
    found: Experience = {}
    for path in sorted(store.root.glob("grids/*/cells.csv")):
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                if row.get("state") != "done":
                    continue
                kind = found.setdefault((row["chemistry"], row["scaffold"], row["backend"]), _Experience())
                kind.cells += 1
                kind.seconds += float(row["wall_s"] or 0.0)
                kind.tokens += float(row["tokens"] or 0.0)
                kind.cost_usd += float(row["cost_usd"] or 0.0)
    return found


def need_of(cell: Calibration, past: Experience) -> Need:
    """What one cell takes at most (simulations, calls) and about (the rest)."""
    config = cell.config
    asks = _asks_a_model(config)
    calls = config.rounds + (1 if config.warm_up and config.scaffold.warm_up else 0) if asks else 0
    known = past.get((cell.task.chemistry, cell.config.scaffold.name, cell.backend.use))
    if known is not None:
        count = known.cells
        tokens = round(known.tokens / count)
        return Need(
            1,
            config.simulations,
            calls,
            known.seconds / count,
            tokens,
            _cost(cell, tokens, known.cost_usd / count),
            True,
        )
    simulation_s = _SIMULATION_S.get(cell.task.chemistry, _USUAL_SIMULATION_S)
    model = asks and config.backend != "rules"
    tokens = _CALL_TOKENS * calls if model else 0
    seconds = _START_S + simulation_s * config.simulations + (_CALL_S * calls if model else 0.0)
    return Need(1, config.simulations, calls, seconds, tokens, _cost(cell, tokens, None))


def _cost(cell: Calibration, tokens: int, known: float | None) -> float | None:
    if known is not None:
        return known
    if not tokens or on_own_machines(cell.backend.use, cell.backend.options):
        return 0.0
    price = cell.backend.usd_per_million_tokens
    return None if price is None else price * tokens / 1e6


def _asks_a_model(config: RunConfig) -> bool:
    return config.scaffold.proposer.use in ("agent", "hybrid")


def estimate(cells: Sequence[Calibration], store: Store) -> dict[str, Need]:
    """What is still to be done, by scaffold and backend, finished cells left out."""
    past = experience(store)
    needs: dict[str, Need] = {}
    for cell in cells:
        name = f"{cell.config.scaffold.name} · {cell.backend.use}"
        needs.setdefault(name, Need())
        if not (cell.identity and store.result(cell.identity)) and not cell.task.trouble:
            needs[name] = needs[name] + need_of(cell, past)
    return needs
