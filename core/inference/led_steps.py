"""Steps of a fit by a low-fidelity model: to where a fit of that model, corrected, ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..trajectory import FloatArray
from .fit_settings import Box, Settings
from .guided_steps import GuidedSteps
from .low_fidelity import LowFidelity

_PATIENCE = 3
"""Steps in a row that may fail; the model learns from each."""

_LEADS = 0.1
"""Share of the cost that a step must gain: at less, other steps gain as much in less time."""

_LONGEST = 4
"""Simulations of a fit of the low-fidelity model at most, in units of those that determine a linear model."""

_STUCK = 0.1
"""Share of the cost above which the first fit of the low-fidelity model may have ended in a local minimum, and begins
elsewhere too. Where nothing is in its way it comes to a hundredth; in two published tasks, of which a step of the
protocol vanishes, it left 0.3 and 0.8."""

Fit = Callable[[LowFidelity, FloatArray, FloatArray, Settings, NDArray[np.bool_], Box, int], tuple[FloatArray, float]]
"""Fits the corrected model from a point and its residuals in so many simulations; the best point and its cost."""


class LedSteps(GuidedSteps):
    """Steps to where a fit of the corrected low-fidelity model ends.

    Parameters
    ----------
    model : LowFidelity
        Learns from every step.
    fit : callable
        Fits it.
    settings, free, box
        Those of the fit of the full model.
    """

    least_share = _LEADS

    def __init__(self, model: LowFidelity, fit: Fit, settings: Settings, free: NDArray[np.bool_], box: Box) -> None:
        super().__init__(settings.radius, _PATIENCE)
        self._model, self._fit = model, fit
        self._settings, self._free, self._box = settings, free, box

    @property
    def suffices(self) -> bool:
        """Whether a fit ends where this model leads no further: where it has led somewhere, and is meant to suffice."""
        return self._model.suffices and (self._model.has_led or self.expects)

    def judge(
        self, here: FloatArray, there: FloatArray, residual: FloatArray | None, gained: float, cost: float, worth: float
    ) -> None:
        """See `GuidedSteps.judge`."""
        self._model.learn(there, residual)
        super().judge(here, there, residual, gained, cost, worth)
        self._model.has_led |= gained > 0

    def derivatives(self, point: FloatArray) -> FloatArray:
        """See `GuidedSteps.derivatives`; of the point that was judged last."""
        assert self._model.jacobian is not None
        return self._model.jacobian.copy()

    def _least(self, point: FloatArray, residual: FloatArray, cost: float) -> tuple[FloatArray, float] | None:
        if not self._model.learn(point, residual):
            return None
        near = replace(
            self._box,
            lower=np.maximum(self._box.lower, point - self._reach),
            upper=np.minimum(self._box.upper, point + self._reach),
        )
        enough = float(np.sqrt(self._model.worth(cost) / len(residual)))
        settings = replace(self._settings, enough=max(self._settings.enough, enough))
        fitted = self._fitted(point, residual, settings, near)
        if self._settings.elsewhere > 0 and not self._model.has_led and fitted[1] > _STUCK * cost:
            fitted = self._from_elsewhere(point, fitted, settings, near)
        there, least = fitted
        return there, cost - least

    def _fitted(
        self, point: FloatArray, residual: FloatArray, settings: Settings, box: Box
    ) -> tuple[FloatArray, float]:
        budget = _LONGEST * (int(np.count_nonzero(self._free)) + 1)
        return self._fit(self._model, point, residual, settings, self._free, box, budget)

    def _from_elsewhere(
        self, point: FloatArray, fitted: tuple[FloatArray, float], settings: Settings, box: Box
    ) -> tuple[FloatArray, float]:
        """The better of a fit and one that begins at the best of the points to either side of its start.

        Far from the record a slope may have the wrong sign, as where a step of the protocol has vanished.
        """
        beside = box.beside(point, self._settings.elsewhere)
        starts = [start for start, moves in zip(beside, np.tile(self._free, 2), strict=True) if moves]
        seen = zip(starts, self._model.corrected(starts), strict=True)
        ran = [(start, residual) for start, residual in seen if residual is not None]
        if not ran:
            return fitted
        start, residual = min(ran, key=lambda pair: box.cost(*pair))
        jacobian, self._model.jacobian = self._model.jacobian, None
        again = self._fitted(start, residual, settings, box)
        if again[1] < fitted[1]:
            return again
        self._model.jacobian = jacobian
        return fitted

    def _mispredicted(self, residual: FloatArray | None, gained: float) -> bool:
        return gained <= 0
