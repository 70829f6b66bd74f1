"""A side trip on the agent's account: a small fit of its own that leaves the main one alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ....core.least_squares import LeastSquares, Settings
from ....core.parameters import Candidate, ParameterSpace
from ....core.trajectory import FloatArray
from ....core.trial import Trial

_EASED_ABOVE = 30.0
"""Residuals, in tolerances, beyond which an eased fit hears only the order of magnitude."""


class Excursion:
    """Simulates at most ``allowance`` candidates.

    Parameters
    ----------
    space : ParameterSpace
        What may move.
    start : ndarray of shape (p,)
        Where from, in the unit box.
    allowance : int
        Simulations at most.
    residual : ndarray of shape (m,), optional
        The residuals there, if known.
    jacobian : ndarray of shape (m, p), optional
        Derivatives believed there.
    free : ndarray of bool, shape (p,), optional
        What may move.
    eased : bool
        Whether to flatten large residuals: a step that has vanished then no longer drowns the rest.
    """

    def __init__(
        self,
        space: ParameterSpace,
        start: FloatArray,
        allowance: int,
        residual: FloatArray | None = None,
        jacobian: FloatArray | None = None,
        free: NDArray[np.bool_] | None = None,
        eased: bool = False,
    ) -> None:
        self._space = space
        self._left = allowance
        self._eased = eased
        if residual is not None and jacobian is not None and eased:
            jacobian = jacobian / np.sqrt(1.0 + np.square(residual / _EASED_ABOVE))[:, None]
        self._search = LeastSquares(start, self._heard(residual), Settings(radius=0.15), free, jacobian)

    def ask(self, limit: int) -> list[Candidate]:
        """What to simulate next; empty when the trip is over or cannot go on within the limit."""
        limit = min(limit, self._left)
        points = self._search.ask(limit) if limit > 0 else []
        # A first Jacobian that the allowance does not cover ends the trip.
        if not points or len(points) > limit:
            self._left = 0
            return []
        return [self._space.from_unit(point) for point in points]

    def tell(self, trials: Sequence[Trial]) -> None:
        """Take in the trials of the candidates asked for."""
        if not trials or len(trials) < len(self._search.ask()):
            self._left = 0
            return
        self._left -= len(trials)
        self._search.tell([self._heard(trial.residuals) for trial in trials])

    @property
    def over(self) -> bool:
        """Whether nothing more is to come."""
        return self._left <= 0 or self._search.done

    def _heard(self, residual: FloatArray | None) -> FloatArray | None:
        if residual is None or not self._eased:
            return residual
        return _EASED_ABOVE * np.arcsinh(residual / _EASED_ABOVE)
