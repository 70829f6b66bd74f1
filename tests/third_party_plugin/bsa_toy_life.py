"""A record of a whole life, made on paper: its cycle table, and the curves of a few cycles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from bsa.core.ageing.choice import kept_cycles
from bsa.core.ageing.cycle_table import CycleTable
from bsa.core.cell import CELL
from bsa.core.feedback import Feedback
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from bsa.core.proposal import Proposal
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa_toy_cell import space

STEPS = ("Charge at 1 A until 4.2 V", "Discharge at 1 A until 3 V")


def life(count: int, lost: float, bend: float = 1.0) -> Trajectory:
    """``lost`` A.h of 1 A.h go over the whole life, late where ``bend`` is large; 21 samples a step."""
    kept = kept_cycles(count)
    share = (np.arange(count) / (count - 1)) ** bend
    table = CycleTable(np.arange(1.0, count + 1), 1.0 - lost * share, 0.02 * (1.0 + lost * share), np.full(count, 4.2))
    rows = np.linspace(0.0, 1.0, 21)
    time, current, voltage, steps = [], [], [], []
    for cycle in kept:
        for position, (kind, sign) in enumerate(((StepKind.CC_CHARGE, -1.0), (StepKind.CC_DISCHARGE, 1.0))):
            start = time[-1][-1] if time else 0.0
            steps.append(Step(kind, 21 * len(time), 21 * (len(time) + 1), cycle, STEPS[position], position))
            time.append(start + 3600.0 * table.capacity_ah[cycle - 1] * rows)
            current.append(np.full(21, sign))
            voltage.append((3.2 + rows if sign < 0 else 4.2 - rows) - 0.02 * lost * sign)
    parts = (np.concatenate(part) for part in (time, current, voltage))
    return Trajectory(*parts, None, tuple(steps), cycle_table=table)


def life_task(target: Trajectory) -> Task:
    count = len(target.cycle_table.cycle) if target.cycle_table is not None else 0
    experiment = Experiment("life", target, (STEPS,) * count, detailed_cycles=target.cycles)
    return Task("ageing", CellModel("x"), space(), (experiment,), domain=CELL)


def fading_task() -> Task:
    """A life of 100 cycles that fades by 0.2 A.h, and the same once more that is not fitted."""
    box = ParameterSpace((Parameter("rate", 0.3, 0.0, 1.0), Parameter("other", 0.5, 0.0, 1.0)))
    task = replace(life_task(life(100, 0.2)), space=box)
    return replace(task, held_out=(replace(task.experiments[0], name="later"),))


class FadingLives:
    """All that a run asks of its plugins, for `fading_task`: one step of a search, and lives on paper.

    It is interrupted after so many simulations of other experiments than the task's; those of reference accuracy do not
    count.
    """

    def __init__(self, after: int = 1000) -> None:
        self.left, self.made, self.exact, self.scored = after, 0, 0, 0

    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        self.scored += exact * len(candidates)
        return self._lives(candidates)

    def _lives(self, candidates: Sequence[Candidate]) -> Iterator[tuple[int, Outcome]]:
        for place, candidate in enumerate(candidates):
            yield place, Outcome((ExperimentRun(life(100, candidate["rate"])),))

    def simulate_variant(
        self, candidates: Sequence[Candidate], experiments: object, exact: bool = False
    ) -> Iterator[tuple[int, Outcome]]:
        for place, outcome in self._lives(candidates):
            if not exact and self.left == 0:
                raise KeyboardInterrupt
            self.left -= not exact
            self.made += not exact
            self.exact += exact
            yield place, outcome

    def simulate_low_fidelity(self, candidates: Sequence[Candidate]) -> None:
        return None

    def propose(self, context: object) -> Proposal:
        return Proposal(({"rate": 0.2, "other": 0.5},), finished=True)

    def build_feedback(self, *_: object) -> Feedback:
        return Feedback({})

    def recall(self, budget: int) -> list[Any]:
        return []

    def next_protocols(self) -> Mapping[str, Any]:
        return {}

    def export(self, candidate: Candidate) -> Mapping[str, str]:
        return {}

    def nothing(self, *_: object) -> None:
        """The answer to everything else."""

    equilibrium = simulate_finer = warm_up = remember = weighs_priors = close = nothing
