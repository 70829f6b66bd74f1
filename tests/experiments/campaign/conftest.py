"""Grids on the toy cell: small, and solved on paper."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from bsa.core.encoding import encode_task
from bsa.experiments.campaign.cell import carry_out
from bsa.experiments.campaign.execution import Watcher
from bsa.experiments.campaign.results import read_manifest, write_manifest
from bsa.experiments.campaign.running import Plan, plan_grid
from bsa_toy_cell import HIDDEN, toy_task

MakePlan = Callable[..., Plan]


class Quiet(Watcher):
    """Watches a grid and remembers."""

    def __init__(self) -> None:
        self.ran: list[str] = []
        self.found: list[str] = []
        self.losses: list[str] = []

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        pass

    def ended(self, cell, report, found):
        (self.found if found else self.ran).append(cell.identity)

    def lost(self, cell, reason):
        self.losses.append(cell.identity)


class Here:
    """A pool that carries out cells in this process, and can be told to misbehave."""

    workers = 1

    def __init__(self) -> None:
        self.orders = []
        self.carried = []
        self.answers = {}

    @property
    def free(self):
        return 1 - len(self.orders)

    def submit(self, cell, store):
        self.orders.append((cell, store))

    def collect(self, patience_s):
        found = []
        while self.orders:
            cell, store = self.orders.pop()
            answer = self.answers.get(cell.identity)
            self.carried.append(cell.identity)
            found.append(answer(cell) if answer else carry_out(cell, store))
        return found

    def close(self):
        self.orders.clear()


def write_grid(folder: Path, tasks: int = 2, **changes: Any) -> Path:
    """A grid file of toy cells beside its tasks."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(tasks):
        hidden = {name: value * (1.0 + 0.05 * number) for name, value in HIDDEN.items()}
        text = json.dumps(encode_task(toy_task(hidden, f"toy-{number}")))
        (folder / f"toy-{number}.json").write_text(text)
    content = {
        "name": "toys",
        "tasks": [f"toy-{number}.json" for number in range(tasks)],
        "scaffolds": ["full", "no-memory"],
        "seeds": [1],
        "rounds": 2,
        "warm_up": 2,
        "simulations": 5,
        "settings": {"simulator.use": "toy-cell"},
        **changes,
    }
    path = folder / "toys.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def noted(plan: Plan) -> dict[str, Any]:
    """The manifest of a plan, written and read."""
    write_manifest(plan.about, plan.cells, plan.folder)
    return read_manifest(plan.folder)


@pytest.fixture
def make_plan(tmp_path: Path) -> MakePlan:
    """Plans a grid of toy cells in a store of its own."""

    def make(store: str = "store", changes: dict[str, Any] | None = None, **content: Any) -> Plan:
        return plan_grid(str(write_grid(tmp_path / "grid", **content)), tmp_path / store, changes)

    return make
