"""A small fit at the agent's request, which leaves the main fit unchanged."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ....core.comparison.robust_loss import robust
from ....core.inference.fit_settings import Settings
from ....core.inference.least_squares import LeastSquares
from ....core.parameters import Candidate, ParameterSpace
from ....core.trajectory import FloatArray
from ....core.trial import Trial

_ROBUST_ABOVE = 30.0
"""Residuals, in tolerances, of which a robust fit counts only the order of magnitude."""


class AgentSearch:
    """Simulates at most ``allowance`` candidates.

    It begins at ``start``, shape (p,), in the unit box, with the residuals, shape (m,), and derivatives, shape (m, p),
    that are known or assumed there; ``free``, shape (p,), is what may move. ``robust`` flattens large residuals: a
    step that has vanished then no longer drowns the rest.
    """

    def __init__(
        self,
        space: ParameterSpace,
        start: FloatArray,
        allowance: int,
        residual: FloatArray | None = None,
        jacobian: FloatArray | None = None,
        free: NDArray[np.bool_] | None = None,
        robust: bool = False,
    ) -> None:
        self._space = space
        self._left = allowance
        self._robust = robust
        self._search = LeastSquares(start, residual, Settings(radius=0.15), free, jacobian)

    def ask(self, limit: int) -> list[Candidate]:
        """What to simulate next; empty when the search is over or cannot go on within the limit."""
        limit = min(limit, self._left)
        points = self._search.ask(limit) if limit > 0 else []
        # A first Jacobian that the allowance does not cover ends the search.
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
        told = [trial.residuals for trial in trials]
        if self._robust:
            told = [None if residual is None else robust(residual, _ROBUST_ABOVE) for residual in told]
        self._search.tell(told)

    @property
    def over(self) -> bool:
        """Whether nothing more is to come."""
        return self._left <= 0 or self._search.done
