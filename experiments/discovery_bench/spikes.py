"""Effects that can be hidden in measured records: what the same cycler would have written down had they been there.

A resistance in series, a hysteresis, a leak beside the cell, and errors of the instruments change the current or the
voltage of a record by a known rule, whatever the cell is. No model is simulated: all that a real cell has and no model
knows stays in the record.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...core.trajectory import FloatArray, Trajectory
from .draws import Setting, drawn_effects, drawn_strength, log_uniform, setting_of
from .hidden_physics import EFFECTS, OUTSIDE, HiddenEffect

_CONTACT = "contact-resistance"

_BOTH_WAYS = 0.1
"""Share of its capacity that a cell is charged by at least if its records show a hysteresis."""

_SPIKES = tuple(
    effect
    for effect in EFFECTS
    if effect.key == _CONTACT or effect.voltage is not None or effect.instrument is not None or effect.leak
)


def _slow_memory(time: FloatArray, rate: FloatArray) -> FloatArray:
    """The current smoothed over twenty minutes, exactly for one that is constant from sample to sample."""
    state = np.zeros(len(time))
    for k in range(1, len(time)):
        mean = 0.5 * (rate[k] + rate[k - 1])
        state[k] = mean + (state[k - 1] - mean) * np.exp(-(time[k] - time[k - 1]) / 1200.0)
    return -state


_OUTSIDE: Mapping[str, Callable[[FloatArray, FloatArray], FloatArray]] = {
    "saturating-overpotential": lambda time, rate: -np.tanh(rate / 0.3),
    "slow-memory": _slow_memory,
    "drifting-reference": lambda time, rate: np.log(1.0 + time / 600.0),
    "chamber-ripple": lambda time, rate: np.sin(2.0 * np.pi * time / 2400.0),
}
"""Volts that are added by a strength of 1 V, from the time (s) and the current over the capacity (1/h): the effects of
no catalogue that need no state of the cell."""


@dataclass(frozen=True)
class Spike:
    """What is hidden in the records of a cell."""

    setting: Setting
    effects: tuple[HiddenEffect, ...] = ()
    strengths: Mapping[str, float] = field(default_factory=dict)  # By the effects' keys.
    outside: str = ""  # Name of an effect that no catalogue has; empty for none.
    outside_strength: float = 0.0  # Its strength, V.


def draw_spike(seed: int, number: int, attempt: int, records: Sequence[Trajectory], capacity_ah: float) -> Spike:
    """Draw what is hidden in case ``number`` of a seed, counted from 0, among what the records can show at all."""
    rng = np.random.default_rng([seed, number, attempt, 5])
    setting = setting_of(seed, number)
    charged = max(float(np.sum(np.maximum(-np.diff(one.discharge_capacity), 0.0))) for one in records)
    possible = [e for e in _SPIKES if e.records != "charge" or charged > _BOTH_WAYS * capacity_ah]
    effects = drawn_effects(setting, rng, possible)
    strengths = {effect.key: drawn_strength(effect, capacity_ah / 5.0, rng) for effect in effects}
    if setting != "outside":
        return Spike(setting, effects, strengths)
    outside = str(rng.choice(list(_OUTSIDE)))
    return Spike(setting, outside=outside, outside_strength=log_uniform(*OUTSIDE[outside][1:], rng))


def spiked(record: Trajectory, spike: Spike, capacity_ah: float) -> Trajectory:
    """The record as it would have been written down with the effects.

    Effects of the cell and its leads come before those of the instruments, as in `hidden_cell.measure`.
    """
    time, through, voltage = record.time, record.current, record.voltage
    for effect in spike.effects:
        strength = spike.strengths[effect.key]
        if effect.key == _CONTACT:
            voltage = voltage - strength * through
        elif effect.voltage is not None:
            voltage = voltage + effect.voltage(time, through, strength, capacity_ah)
    if spike.outside:
        shape = _OUTSIDE[spike.outside](time - time[0], through / capacity_ah)
        voltage = voltage + spike.outside_strength * shape
    current = through - sum(spike.strengths[effect.key] for effect in spike.effects if effect.leak)
    for effect in spike.effects:
        if effect.instrument is not None:
            current, voltage = effect.instrument(time, current, voltage, spike.strengths[effect.key])
    return record.changed(current=current, voltage=voltage)
