"""The time by which an instrument writes the voltage later than the current."""

from dataclasses import replace

import numpy as np

from ..trajectory import FloatArray
from .clock import usual_interval
from .samples import Samples

_EVEN_SAMPLES = 20_000
"""Samples that are looked at, at most: minutes of a drive cycle tell the lag."""

_CHANGES = 100
"""Changes of the current by a twentieth of its largest, at least: a few steps tell how they were sampled, no more."""

_APART = 3
"""Samples between the two of a difference: one interval alone shows how the instrument averages."""

_TRIED = np.array([0.0, *(tenths / 10 for tenths in range(-20, 31) if tenths)])
"""Lags that are tried, in sampling intervals; none first."""

_LEFT = 0.5
"""A lag is one where it leaves at most this share of what no lag leaves of the changes of the voltage."""


def without_lag(samples: Samples, asked_s: float | None) -> Samples:
    """The samples with a voltage that was written at the time of the current.

    The lag that is taken back is ``asked_s``, in s; None stands for that which the samples show, if they show one.
    """
    if asked_s == 0.0:
        return samples
    if asked_s is None:
        shown = shown_lag(samples)
        if shown is None:
            return samples
        lag_s, note = shown
    else:
        lag_s, note = asked_s, f"the voltage is taken {asked_s:.3g} s later, as was asked."
    return replace(samples, voltage=np.interp(samples.time + lag_s, samples.time, samples.voltage)).noted(note)


def shown_lag(samples: Samples) -> tuple[float, str] | None:
    """The lag that a varying current shows, s, and what is to be said of it.

    None where there is none, or the current hardly varies. The ohmic part of a cell's voltage follows its current at
    once: with the right lag changes of the voltage are nearly proportional to those of the current.
    """
    interval = usual_interval(samples.time)
    time = samples.time[0] + interval * np.arange(min(_EVEN_SAMPLES, int(np.ptp(samples.time) / interval)))
    if len(time) <= _APART:
        return None
    current = _differences(time, samples.time, samples.current)
    if np.count_nonzero(np.abs(current) > 0.05 * np.max(np.abs(samples.current))) < _CHANGES:
        return None
    explained = [
        _explained(current, _differences(time + lag * interval, samples.time, samples.voltage)) for lag in _TRIED
    ]
    best = int(np.argmax(explained))
    if best == 0 or 1.0 - explained[best] > _LEFT * (1.0 - explained[0]):
        return None
    lag_s = float(_TRIED[best]) * interval
    return lag_s, (
        f"the voltage follows the current {lag_s:.2g} s late, which is taken back (--voltage-lag 0 keeps it): "
        f"{100 * explained[best]:.0f} % of its changes within {_APART * interval:.2g} s are then proportional to those "
        f"of the current, in place of {100 * explained[0]:.0f} %."
    )


def _differences(at: FloatArray, time: FloatArray, values: FloatArray) -> FloatArray:
    interpolated = np.interp(at, time, values)
    return np.asarray(interpolated[_APART:] - interpolated[:-_APART])


def _explained(current: FloatArray, voltage: FloatArray) -> float:
    """Share of the squared changes of the voltage that is proportional to those of the current."""
    whole = float(current @ current) * float(voltage @ voltage)
    return float(current @ voltage) ** 2 / whole if whole > 0.0 else 0.0
