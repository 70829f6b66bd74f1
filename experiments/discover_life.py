"""``bsa discover --life``: which mechanism ages a cell."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from ..backends.opening import open_backend
from ..core.ageing.changes import Changes
from ..core.discovery.discovery import finite
from ..core.discovery.drift import Drift
from ..core.discovery.explanation import Explanation
from ..core.discovery.findings import Findings, Listener
from ..core.discovery.life import DEVIATION_V, LifeDiscovery
from ..core.discovery.rules import RULES, Gap, bic_difference
from ..core.effect import Effect, Evidence
from ..core.errors import BsaError
from ..core.files import write_text
from ..core.parameters import Candidate
from ..core.residuals import residuals
from ..core.simulation import Outcome
from ..core.task import Task
from ..core.task_reduction import shortened
from ..core.trajectory import FloatArray
from ..plugins.pybamm.long_experiment import LongExperiment
from ..plugins.pybamm.parameter_sets import pybamm
from .degradation_modes import degradation_modes
from .effect_choice import effects_of
from .report.life_discovery import render
from .request import CellChoice, Records, run_config, task_of_records
from .run import execute_run

RESULT = "discovery.json"

FITTED = 0.6
"""Share of a life that is fitted where nothing else is said: the later cycles tell mechanisms apart by where they
lead."""

_CELL_SIMULATIONS = 60
"""Simulations of the first cycle, by which the cell is fitted: two Jacobians of some twenty-five parameters."""


@dataclass(frozen=True)
class LifeFindings:
    """What was found in a life."""

    findings: Findings  # The verdict, and every mechanism that was fitted.
    modes: tuple[Drift, ...]  # Lithium, active material and resistance by cycle, whatever the mechanism.
    fit_cycles: int  # The last cycle that was fitted.
    simulations: int  # Lives that were simulated.

    @property
    def names(self) -> tuple[str, ...]:
        """The mechanisms found; empty unless the verdict is ``"effect-found"`` or ``"ambiguous"``."""
        return self.findings.best.names if self.findings.verdict in ("effect-found", "ambiguous") else ()

    def as_json(self, notes: Sequence[str]) -> dict[str, Any]:
        """The contents of ``discovery.json``; errors are in standard deviations of the residuals."""
        findings = self.findings
        return {
            "verdict": findings.verdict,
            "reason": findings.reason,
            "effects": list(self.names),
            "rivals": [list(rival.names) for rival in findings.rivals],
            "fit_cycles": self.fit_cycles,
            "base": _errors(findings.base),
            "candidates": [self._candidate(one) for one in findings.explanations],
            "modes": [asdict(mode) for mode in self.modes],
            "simulations": self.simulations,
            "notes": list(notes),
        }

    def _candidate(self, one: Explanation) -> dict[str, Any]:
        base = self.findings.base
        if one is self.findings.best and self.names:
            rejected = ""
        elif one in self.findings.rivals:
            rejected = "cannot be told from the best"
        else:
            rejected = RULES.objection_to(one, Gap(base, base, DEVIATION_V, DEVIATION_V))
            rejected = rejected or "explains the life less well than the best"
        return {
            "name": one.label,
            **_errors(one),
            "delta_bic": bic_difference(base, one),
            "parameters": {key: [asdict(estimate) for estimate in rows] for key, rows in one.estimates.items()},
            "converged": bool(one.settled),
            "rejected": rejected,
        }


def discover_life(
    records: Records,
    cell: CellChoice,
    out: Path,
    effects: Sequence[str] | None = None,
    max_effects: int = 2,
    listener: Listener = lambda text: None,
) -> LifeFindings:
    """Fit the cell to the first cycle of a life, then each mechanism to the fitted cycles, and say which one it is.

    Parameters
    ----------
    records : Records
        One life; ``fit_cycles`` of it are fitted, `FITTED` of it if left out.
    cell : CellChoice
        The base model, which need not age.
    out : Path
        Where ``discovery.json``, ``report.html`` and the run of the first cycle go.
    effects : sequence of str, optional
        Mechanisms to consider; all effects of ageing by default.

    Raises
    ------
    BsaError
        If a record, a parameter set or an effect is wrong.
    """
    if len(records.sources) > 1 and not records.read.join:
        raise BsaError(
            f"{len(records.sources)} lives were given.", "give one, or --join the files of one cell; each is its own."
        )
    pybamm.set_logging_level("CRITICAL")
    ageless = replace(cell, options={"SEI": "none", **cell.options}, search=cell.search or "cell")
    task = task_of_records(replace(records, life=True, fit_cycles=None), ageless)
    (experiment,) = task.experiments
    count = experiment.target.cycles[-1]
    fit_cycles = records.fit_cycles or round(FITTED * count)
    best = _first_cycle(task, out / "cell")
    listener(f"the cell is fitted to its first cycle; mechanisms to cycles up to {fit_cycles} of {count}")
    simulator = LifeSimulator(task, best)
    evidence = Evidence(task.cell.model, task.cell.options, count, 0.0, 1.0)
    chosen = [e for e in effects_of(effects) if e.ages and not (e.lacks and e.lacks(evidence))]
    modes = degradation_modes(task, best)
    for mode in modes:
        listener(f"{mode.name}: {mode.per_100_cycles:+.2g} ± {mode.half_per_100_cycles:.1g} in 100 cycles")
    (new,) = simulator((), [{}])
    discovery = LifeDiscovery(simulator, Changes(task, fit_cycles, new), listener, max_effects)
    found = LifeFindings(discovery.run(chosen), tuple(modes), fit_cycles, discovery.simulations)
    content = found.as_json(task.notes)
    write_text(out / RESULT, json.dumps(finite(content), indent=1, allow_nan=False))
    write_text(out / "report.html", render(content))
    return found


def _first_cycle(task: Task, folder: Path) -> Candidate:
    """The cell that shows the first cycle best, by a run in a folder of its own."""
    (experiment,) = task.experiments
    first = shortened(experiment, experiment.target.steps[0].cycle)
    alone = replace(task, name=f"{task.name}, first cycle", experiments=(first,), held_out=())
    budget = {"rounds": _CELL_SIMULATIONS, "simulations": _CELL_SIMULATIONS, "proposer.options.order": ["joint"]}
    config = run_config("ageing", "rules", {}, budget)
    return execute_run(alone, config, folder, open_backend("rules", {})).best.candidate


class LifeSimulator:
    """Simulates a whole life with effects on a cell that stays; models are compiled once for each set of effects.

    Parameters
    ----------
    task : Task
        The life.
    cell : Candidate
        The cell's own parameters.
    """

    def __init__(self, task: Task, cell: Candidate) -> None:
        self._task, self._cell = task, cell
        self._effects: tuple[str, ...] | None = None
        self._compiled: LongExperiment | None = None

    def __call__(self, effects: tuple[Effect, ...], candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        """See `Simulate`."""
        keys = tuple(effect.key for effect in effects)
        if self._compiled is None or keys != self._effects:
            task = self._task
            self._effects = keys
            self._compiled = LongExperiment(task.cell, task.experiments[0], task.space.targets, effects=effects)
        return [self._one(self._compiled, candidate) for candidate in candidates]

    def _one(self, compiled: LongExperiment, strengths: Candidate) -> FloatArray | None:
        return residuals(self._task, Outcome((compiled.solve({**self._cell, **strengths}),)))


def _errors(found: Explanation) -> dict[str, float]:
    return {"error": found.rmse_v / DEVIATION_V, "later_error": found.held_rmse_v / DEVIATION_V}
