"""A cell whose capacity fades by a known rule, as a long record."""

from collections.abc import Callable

import numpy as np
import pytest
from bsa.core.ageing.choice import kept_cycles
from bsa.core.ageing.summary import in_sequence, line_of, table_of
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory

CYCLE = ("Charge at 1 A until 4.2 V", "Rest for 1 minute", "Discharge at 1 A until 3 V")


def one_cycle(capacity_ah: float, resistance_ohm: float) -> Trajectory:
    """Charge, rest and discharge at 1 A, 41 samples each."""
    duration = 3600.0 * capacity_ah
    share = np.linspace(0.0, 1.0, 41)
    time = np.concatenate([share * duration, duration + 60.0 * share, duration + 60.0 + share * duration])
    current = np.repeat([-1.0, 0.0, 1.0], 41)
    open_circuit = np.concatenate([3.2 + share, np.full(41, 4.2), 4.2 - share])
    kinds = (StepKind.CC_CHARGE, StepKind.REST, StepKind.CC_DISCHARGE)
    steps = tuple(Step(kind, 41 * place, 41 * (place + 1), 1, CYCLE[place], place) for place, kind in enumerate(kinds))
    return Trajectory(time, current, open_circuit - current * resistance_ohm, None, steps)


def long_record(fade: float, rise: float = 0.0, count: int = 50, kept: tuple[int, ...] | None = None) -> Trajectory:
    """``count`` cycles that lose ``fade`` A.h and gain ``rise`` ohm in each."""
    cycles = [(n, one_cycle(1.0 - fade * (n - 1), 0.02 + rise * (n - 1))) for n in range(1, count + 1)]
    table = table_of([line_of(*cycle) for cycle in cycles])
    chosen = kept_cycles(count) if kept is None else kept
    return in_sequence([cycle for cycle in cycles if cycle[0] in chosen], table)


def long_task(target: Trajectory, count: int = 50) -> Task:
    """The task of matching a long record."""
    space = ParameterSpace((Parameter("fade", 1e-3, 1e-4, 1e-2, "log"),))
    experiment = Experiment("life", target, (CYCLE,) * count, detailed_cycles=target.cycles)
    return Task("ageing", CellModel("x"), space, (experiment,))


@pytest.fixture
def record() -> Callable[..., Trajectory]:
    """See `long_record`."""
    return long_record


@pytest.fixture
def task() -> Callable[..., Task]:
    """See `long_task`."""
    return long_task


@pytest.fixture
def outcome() -> Callable[[Trajectory], Outcome]:
    """The outcome of one experiment."""
    return lambda trajectory: Outcome((ExperimentRun(trajectory),))
