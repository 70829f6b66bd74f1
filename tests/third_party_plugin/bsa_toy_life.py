"""A record of a whole life, made on paper: its cycle table, and the curves of a few cycles."""

from __future__ import annotations

import numpy as np
from bsa.core.ageing.choice import kept_cycles
from bsa.core.ageing.cycle_table import CycleTable
from bsa.core.cell import CELL
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
