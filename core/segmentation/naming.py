"""Names what the other passes left, and numbers cycles."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..trajectory import Step, StepKind, Trajectory
from .levels import BRIEF_S, Level, RecordSignals

CYCLE_SHARE = 0.02
"""A step counts as a charge or discharge for cycles when it moves this share of the largest step's charge."""

_FEWEST = 100
"""Points in time at which a drift of the current is looked for, at least."""


def name_steps(signals: RecordSignals, levels: list[Level]) -> None:
    """Name what has no name yet: rests, pulses, constant-current steps and drifting ones."""
    for level in levels:
        if level.sign == 0 and level.kind is None:
            level.kind = StepKind.REST
    for index, level in enumerate(levels):
        if level.kind is not None:
            continue
        beside = [levels[k] for k in (index - 1, index + 1) if 0 <= k < len(levels)]
        calm = [other.kind in (StepKind.REST, StepKind.PULSE) or _brief(other) for other in beside]
        rests = any(other.kind is StepKind.REST for other in beside)
        if _brief(level) and rests and all(calm):
            level.kind = StepKind.PULSE
        elif _drifts(signals, level):
            level.kind = StepKind.DRIVE
        else:
            level.kind = StepKind.CC_CHARGE if level.mean < 0 else StepKind.CC_DISCHARGE


def _brief(level: Level) -> bool:
    return level.kind is None and level.sign != 0 and level.seconds <= BRIEF_S


def _drifts(signals: RecordSignals, level: Level) -> bool:
    # By time: a cycler may take a tenth of the samples while it switches the current on.
    part = slice(level.start, level.stop)
    times = np.linspace(signals.time[level.start], signals.time[level.stop - 1], max(level.samples, _FEWEST))
    low, high = np.quantile(np.interp(times, signals.time[part], signals.current[part]), [0.05, 0.95])
    return bool(high - low > max(0.1 * abs(level.mean), 10.0 * signals.noise))


def numbered(
    trajectory: Trajectory, levels: list[Level], cycles: NDArray[np.int64] | None, tests: Collection[int] = ()
) -> tuple[Step, ...]:
    """Steps with their cycles, the given ones if any; ``tests`` are the first samples of tests joined to the first."""
    numbers = _counted(trajectory, levels) if cycles is None else [int(cycles[level.start]) for level in levels]
    steps = [Step(str(one.kind), one.start, one.stop, number) for one, number in zip(levels, numbers, strict=True)]
    return _merged(steps, tests)


def _counted(trajectory: Trajectory, levels: list[Level]) -> list[int]:
    """The cycle of each level, by the rule that stands with `segment`."""
    passed = trajectory.discharge_capacity
    carried = [
        0.0 if level.kind in (StepKind.REST, StepKind.PULSE) else float(passed[level.stop - 1] - passed[level.start])
        for level in levels
    ]
    enough = CYCLE_SHARE * max((abs(charge) for charge in carried), default=0.0)
    numbers: list[int] = []
    cycle, direction, latest = 1, 0.0, 0.0
    for charge in carried:
        if charge != 0.0 and abs(charge) >= enough:
            way = float(np.sign(charge))
            direction = direction or way
            if way == direction and latest == -direction:
                cycle += 1
            latest = way
        numbers.append(cycle)
    return numbers


def _merged(steps: list[Step], tests: Collection[int]) -> tuple[Step, ...]:
    """Neighbouring rests of one test are one rest; then each step gets its place in its cycle."""
    merged: list[Step] = []
    for step in steps:
        latest = merged[-1] if merged else None
        rests = latest is not None and step.kind is latest.kind is StepKind.REST and step.start not in tests
        if latest and rests and step.cycle == latest.cycle:
            merged[-1] = replace(latest, stop=step.stop)
            continue
        follows = bool(merged) and merged[-1].cycle == step.cycle
        merged.append(replace(step, position=merged[-1].position + 1 if follows else 0))
    return tuple(merged)
