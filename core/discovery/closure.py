"""An empirical correction for what no effect explains; it describes, it does not explain."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..comparison.overlap import weighted_rms
from ..inference.observations import Observations
from ..trajectory import FloatArray

_CONSTANT = "1"

_RIDGE = 1e-3
"""Ridge penalty on the coefficients of functions of unit spread, for each average that is fitted."""

_MEMORY_S = 600.0
"""Time over which the C-rate is smoothed, s."""

_SAME = 1e-6
"""Spread of a function, as a share of its largest value, up to which it is constant but for rounding: it would share
the work of the constant."""


@dataclass(frozen=True)
class Closure:
    """A voltage correction as a smooth function of current, state of charge and temperature."""

    # The functions it is made of; ``i`` is the C-rate, ``z`` the charge drawn over the capacity, minus 1/2, ``m`` the
    # C-rate smoothed over ten minutes, ``T`` the temperature over 298.15 K in units of 10 K.
    terms: tuple[str, ...]
    coefficients: tuple[float, ...]  # Their weights, mV.
    # rmse_before_mv, rmse_after_mv: Root mean square residual without and with it, on the fitted data.
    rmse_before_mv: float
    rmse_after_mv: float
    label: str = "empirical: a description of the residual, not a physical effect"  # Says that it is empirical.


def fit_closure(observations: Sequence[Observations], errors: Sequence[FloatArray], capacity_ah: float) -> Closure:
    """Fit the correction to errors (measured minus simulated voltage by record, V) by ridge regression."""
    temperatures = [observed.temperature for observed in observations if observed.temperature is not None]
    thermal = len(temperatures) == len(observations) and _varies(np.concatenate(temperatures))
    rows = [_features(observed, capacity_ah, thermal) for observed in observations]
    columns = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
    names = tuple(name for name, column in columns.items() if name == _CONSTANT or _varies(column))
    matrix = np.column_stack([columns[name] for name in names])
    target = 1e3 * np.concatenate(list(errors))
    weight = np.sqrt(np.concatenate([observed.count for observed in observations]))
    weight = weight / np.mean(weight)
    constant = np.array([name == _CONSTANT for name in names])
    scale = np.where(constant, 1.0, np.std(matrix, axis=0))
    left = matrix / scale * weight[:, None]
    normal = left.T @ left + _RIDGE * len(target) * np.diag(~constant)
    solved = np.linalg.solve(normal, left.T @ (target * weight)) / scale
    rest = target - matrix @ solved
    return Closure(
        names,
        tuple(float(value) for value in solved),
        weighted_rms(weight**2, target),
        weighted_rms(weight**2, rest),
    )


def _varies(column: FloatArray) -> bool:
    return bool(np.std(column) > _SAME * np.max(np.abs(column)))


def _features(observed: Observations, capacity_ah: float, thermal: bool) -> dict[str, FloatArray]:
    """The functions; those of the temperature only where these are known and vary (``thermal``)."""
    i = observed.current / capacity_ah
    z = observed.charge / capacity_ah - 0.5
    memory = np.zeros_like(i)
    for k in range(1, len(i)):
        gap = observed.time[k] - observed.time[k - 1]
        memory[k] = i[k] + (memory[k - 1] - i[k]) * np.exp(-gap / _MEMORY_S)
    features = {
        _CONSTANT: np.ones_like(i),
        "z": z,
        "z^2": z**2,
        "z^3": z**3,
        "i": i,
        "i|i|": i * np.abs(i),
        "i z": i * z,
        "i z^2": i * z**2,
        "m": memory,
        "m z": memory * z,
    }
    if thermal and observed.temperature is not None:
        warm = (observed.temperature - 298.15) / 10
        features |= {"T": warm, "i T": i * warm}
    return features
