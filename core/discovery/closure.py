"""An empirical correction for what no effect explains; it describes, it does not explain."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..trajectory import FloatArray
from .observations import Observations

_RIDGE = 1e-3
_MEMORY_S = 600.0


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
    rows = [_features(observed, capacity_ah) for observed in observations]
    names = tuple(rows[0])
    matrix = np.vstack([np.column_stack(list(row.values())) for row in rows])
    target = 1e3 * np.concatenate(list(errors))
    weight = np.sqrt(np.concatenate([observed.count for observed in observations]))
    weight = weight / np.mean(weight)
    scale = np.maximum(np.std(matrix, axis=0), 1e-9)
    scale[0] = 1.0
    left = matrix / scale * weight[:, None]
    normal = left.T @ left + _RIDGE * len(target) * np.eye(len(names))
    solved = np.linalg.solve(normal, left.T @ (target * weight)) / scale
    rest = target - matrix @ solved
    return Closure(
        names,
        tuple(float(value) for value in solved),
        float(np.sqrt(np.average(target**2, weights=weight**2))),
        float(np.sqrt(np.average(rest**2, weights=weight**2))),
    )


def _features(observed: Observations, capacity_ah: float) -> dict[str, FloatArray]:
    i = observed.current / capacity_ah
    z = observed.charge / capacity_ah - 0.5
    memory = np.zeros_like(i)
    for k in range(1, len(i)):
        gap = observed.time[k] - observed.time[k - 1]
        memory[k] = i[k] + (memory[k - 1] - i[k]) * np.exp(-gap / _MEMORY_S)
    features = {
        "1": np.ones_like(i),
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
    if observed.temperature is not None:
        warm = (observed.temperature - 298.15) / 10
        features |= {"T": warm, "i T": i * warm}
    return features
