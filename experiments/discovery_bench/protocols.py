"""Tests that a cycler runs on a hidden cell: rates, durations, depths and sampling are drawn."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Step:
    """One step: a C-rate (positive on discharge), a drive cycle or a voltage to hold."""

    # C-rate; a sequence is a drive cycle with one value a second; None holds ``hold_v``.
    rate: float | Sequence[float] | None
    seconds: float  # Longest duration.
    until_v: float | None = None  # Voltage at which it ends.
    until_rate: float | None = None  # C-rate at which a hold ends.
    period: float = 10.0  # Sampling interval, s.
    hold_v: float | None = None  # Voltage to hold.


NAMES = ("discharge", "fast", "pulses", "drive", "cycle")
"""Tests within one cycle; ``ageing`` has many."""


def protocol(name: str, lower_v: float, upper_v: float, rng: np.random.Generator) -> list[Step]:
    """Draw the steps of a test.

    ``name`` is one of `NAMES` or ``ageing``: slow or fast discharge with rests, pulses over the range, drive cycle,
    charge and discharge, 8 to 25 cycles. Rates, durations and sampling intervals come from ``rng``.
    """
    sampling = float(np.exp(rng.uniform(np.log(0.5), np.log(3.0))))
    rest = Step(0.0, float(rng.uniform(180.0, 900.0)), period=10.0 * sampling)
    made = {
        "discharge": _discharge,
        "fast": _fast,
        "pulses": _pulses,
        "drive": _drive,
        "cycle": _cycle,
        "ageing": _ageing,
    }[name]
    return [rest, *made(lower_v, upper_v, sampling, rng)]


def _discharge(lower_v: float, upper_v: float, sampling: float, rng: np.random.Generator) -> list[Step]:
    rate = float(rng.uniform(0.1, 0.6))
    relaxing = Step(0.0, float(rng.uniform(900.0, 5400.0)), period=10.0 * sampling)
    return [Step(rate, 4800.0 / rate, lower_v, period=5.0 * sampling / rate), relaxing]


def _fast(lower_v: float, upper_v: float, sampling: float, rng: np.random.Generator) -> list[Step]:
    rate = float(rng.uniform(1.2, 2.5))
    relaxing = Step(0.0, float(rng.uniform(900.0, 3600.0)), period=4.0 * sampling)
    return [Step(rate, 4800.0 / rate, lower_v, period=3.0 * sampling), relaxing]


def _pulses(lower_v: float, upper_v: float, sampling: float, rng: np.random.Generator) -> list[Step]:
    steps: list[Step] = []
    high, length, finest = float(rng.uniform(1.0, 2.5)), float(rng.uniform(10.0, 40.0)), 0.2 * sampling
    for _ in range(int(rng.integers(2, 6))):
        steps += [
            Step(float(rng.uniform(0.5, 1.2)), float(rng.uniform(500.0, 1000.0)), lower_v, period=5.0 * sampling),
            Step(0.0, float(rng.uniform(600.0, 1800.0)), period=5.0 * sampling),
            Step(high, length, lower_v, period=finest),
            Step(0.0, 60.0, period=0.5 * sampling),
            Step(-0.6 * high, length, upper_v, period=finest),
            Step(0.0, 180.0, period=sampling),
        ]
    return steps


def _drive(lower_v: float, upper_v: float, sampling: float, rng: np.random.Generator) -> list[Step]:
    """Acceleration, cruise and regeneration at random, smoothed over three seconds."""
    seconds = int(rng.uniform(1500.0, 3600.0))
    rates: list[float] = []
    while len(rates) < seconds + 3:
        level = float(rng.choice([0.0, 0.4, 0.9, 1.6, 2.4, -0.6], p=[0.2, 0.25, 0.2, 0.15, 0.08, 0.12]))
        rates += [level] * int(rng.integers(4, 25))
    smooth = np.convolve(rates, np.ones(3) / 3, mode="valid")[:seconds]
    mean = float(rng.uniform(0.5, 0.9))
    drawn = [float(rate) for rate in smooth * mean / max(float(np.mean(smooth)), 0.1)]
    return [Step(drawn, float(seconds), lower_v, period=1.0), Step(0.0, 900.0, period=5.0 * sampling)]


def _cycle(lower_v: float, upper_v: float, sampling: float, rng: np.random.Generator) -> list[Step]:
    down, up = float(rng.uniform(0.4, 1.5)), float(rng.uniform(0.3, 0.8))
    pause = float(rng.uniform(600.0, 2400.0))
    return [
        Step(down, 4800.0 / down, lower_v, period=8.0 * sampling),
        Step(0.0, pause, period=10.0 * sampling),
        Step(-up, 4800.0 / up, upper_v, period=10.0 * sampling),
        Step(None, 4000.0, until_rate=0.05, period=10.0 * sampling, hold_v=upper_v),
        Step(0.0, pause, period=15.0 * sampling),
    ]


def _ageing(lower_v: float, upper_v: float, sampling: float, rng: np.random.Generator) -> list[Step]:
    down, up, pause = float(rng.uniform(0.7, 1.3)), float(rng.uniform(0.6, 1.2)), float(rng.uniform(200.0, 900.0))
    cycle = [
        Step(down, 4800.0 / down, lower_v, period=40.0 * sampling),
        Step(0.0, pause, period=40.0 * sampling),
        Step(-up, 4800.0 / up, upper_v, period=40.0 * sampling),
        Step(None, 2400.0, until_rate=0.05, period=40.0 * sampling, hold_v=upper_v),
        Step(0.0, pause, period=40.0 * sampling),
    ]
    return cycle * int(rng.integers(8, 26))
