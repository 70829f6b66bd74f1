"""Tests that a cycler runs on a hidden cell, by name."""

from __future__ import annotations

import numpy as np

from .hidden_cell import Leg


def drive_cycle(seconds: int, mean_rate: float, rng: np.random.Generator) -> list[float]:
    """A C-rate each second: stretches of acceleration, cruise and regeneration, smoothed over three seconds."""
    rates: list[float] = []
    while len(rates) < seconds + 3:
        level = float(rng.choice([0.0, 0.4, 0.9, 1.6, 2.4, -0.6], p=[0.2, 0.25, 0.2, 0.15, 0.08, 0.12]))
        rates += [level] * int(rng.integers(4, 25))
    smooth = np.convolve(rates, np.ones(3) / 3, mode="valid")[:seconds]
    return [float(rate) for rate in smooth * mean_rate / max(float(np.mean(smooth)), 0.1)]


def legs(profile: str, lower_v: float, upper_v: float, rng: np.random.Generator) -> list[Leg]:
    """The steps of a profile.

    Parameters
    ----------
    profile : {'slow', 'fast', 'pulses', 'drive', 'cccv', 'ageing', 'check'}
        Discharge at C/3 or 2C with rests, pulses over the range, drive cycle, charge and discharge, twenty
        cycles; ``check`` (1.3C with rests and a charge) is meant to be held out.
    lower_v, upper_v : float
        Voltage limits of the cell.
    rng : numpy.random.Generator
        For the drive cycle.
    """
    rest = Leg(0.0, 300.0, period=20.0)
    if profile == "slow":
        return [rest, Leg(1 / 3, 12000.0, until_v=lower_v, period=20.0), Leg(0.0, 3600.0, period=15.0)]
    if profile == "fast":
        return [rest, Leg(2.0, 2400.0, until_v=lower_v, period=3.0), Leg(0.0, 2400.0, period=5.0)]
    if profile == "pulses":
        result = [rest]
        for _ in range(3):
            result += [
                Leg(1.0, 900.0, until_v=lower_v, period=5.0),
                Leg(0.0, 900.0, period=5.0),
                Leg(2.0, 20.0, until_v=lower_v, period=0.2),
                Leg(0.0, 60.0, period=0.5),
                Leg(-1.0, 20.0, period=0.2),
                Leg(0.0, 180.0, period=1.0),
            ]
        return result
    if profile == "drive":
        return [
            rest,
            Leg(drive_cycle(2400, 0.8, rng), 2400.0, until_v=lower_v, period=1.0),
            Leg(0.0, 900.0, period=5.0),
        ]
    if profile == "cccv":
        return [
            rest,
            Leg(1.0, 4000.0, until_v=lower_v, period=10.0),
            Leg(0.0, 1200.0, period=10.0),
            Leg(-0.5, 8000.0, until_v=upper_v, period=15.0),
            Leg(None, 4000.0, until_rate=0.05, period=15.0, hold_v=upper_v),
            Leg(0.0, 1800.0, period=15.0),
        ]
    if profile == "ageing":
        result = [rest]
        for _ in range(20):
            result += [
                Leg(1.0, 4500.0, until_v=lower_v, period=60.0),
                Leg(0.0, 300.0, period=60.0),
                Leg(-1.0, 4500.0, until_v=upper_v, period=60.0),
                Leg(None, 2400.0, until_rate=0.05, period=60.0, hold_v=upper_v),
                Leg(0.0, 300.0, period=60.0),
            ]
        return result
    assert profile == "check"
    return [
        rest,
        Leg(1.3, 1500.0, until_v=lower_v, period=5.0),
        Leg(0.0, 1200.0, period=10.0),
        Leg(-0.7, 2400.0, until_v=upper_v, period=10.0),
        Leg(0.0, 1200.0, period=10.0),
        Leg(0.6, 1500.0, until_v=lower_v, period=10.0),
        Leg(0.0, 900.0, period=10.0),
    ]
