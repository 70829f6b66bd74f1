"""Weighted least squares with bounds and priors, from a Jacobian that may be known already."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..parameters import Parameter, ParameterSpace
from ..trajectory import FloatArray
from .linear_step import linear_step

Residuals = Callable[[Sequence[dict[str, float]]], Sequence[FloatArray | None]]
"""Weighted residuals (data minus model, in standard deviations) of candidates that may be simulated side by side; None
for one that cannot be simulated."""

_VISIBLE = 2.0
"""Root mean square change of the residuals, in deviations, over which a slope is taken."""

_SMALLEST_STEP = 0.01
"""The smallest step of a difference as a share of the usual one: below it the integrator's noise shows."""


@dataclass(frozen=True, eq=False)
class Refit:
    """Where a fit ended.

    Attributes
    ----------
    space : ParameterSpace
        What was fitted.
    u : ndarray of shape (p,)
        Coordinates of the best candidate.
    residual : ndarray of shape (n,)
        Weighted residuals there, without the priors.
    jacobian : ndarray of shape (n, p)
        Derivative of the residual by the coordinates.
    converged : bool
        Whether a fresh Jacobian promised no further gain.
    simulations : int
        Simulations spent.
    deviation : ndarray of shape (n,) or None
        The standard deviations that ``residual`` and ``jacobian`` are in, V, where they are known.
    promised : float
        Fall in cost that a full step promised on the fresh Jacobian the fit ended with; infinite if it had none.
    """

    space: ParameterSpace
    u: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    converged: bool
    simulations: int
    deviation: FloatArray | None = None
    promised: float = np.inf

    @property
    def candidate(self) -> dict[str, float]:
        """The best candidate."""
        return self.space.at(self.u)

    @property
    def chi2(self) -> float:
        """Sum of squared weighted residuals."""
        return float(self.residual @ self.residual)

    @property
    def prior_cost(self) -> float:
        """What the priors add to the cost."""
        return float(np.sum((self.space.prior_weights * self.u) ** 2))

    @property
    def cost(self) -> float:
        """``chi2`` plus ``prior_cost``."""
        return self.chi2 + self.prior_cost

    def covariance(self, inflation: float = 1.0) -> FloatArray:
        """Covariance of the coordinates (Gauss-Newton), shape (p, p); ``inflation`` multiplies the data's variances."""
        normal = self.jacobian.T @ self.jacobian / inflation + np.diag(self.space.prior_weights**2 + 1e-10)
        return np.asarray(np.linalg.inv(normal))


def differences(
    residuals: Residuals, space: ParameterSpace, u: FloatArray, here: FloatArray, known: FloatArray | None = None
) -> tuple[FloatArray, int]:
    """Jacobian by forward differences, turned inwards at a bound, and the simulations it took.

    Parameters
    ----------
    residuals : callable
        Weighted residuals of candidates.
    space : ParameterSpace
        What is varied.
    u : ndarray of shape (p,)
        Coordinates at which.
    here : ndarray of shape (n,)
        The residuals there.
    known : ndarray of shape (n, p), optional
        An older Jacobian: sets the steps, so that each column is taken over a change that the data can see and
        no further. At a knee a percent of capacity changes the voltage by hundreds of deviations, and a
        difference over that is a fifth off the slope.

    Notes
    -----
    Columns that cannot be simulated on either side are zero: the fit then leaves that parameter alone.
    """
    jacobian = np.zeros((len(here), len(space)))
    visible = _VISIBLE * float(np.sqrt(len(here)))
    columns = [
        _Column(place, parameter, u[place], 0.0 if known is None else float(np.linalg.norm(known[:, place])), visible)
        for place, parameter in enumerate(space)
    ]
    spent = 0
    while asking := [column for column in columns if column.wanted is not None]:
        moved = []
        for column in asking:
            there = u.copy()
            there[column.place] = column.wanted
            moved.append(space.at(there))
        spent += len(moved)
        for column, there_residual in zip(asking, residuals(moved), strict=True):
            change = column.wanted - u[column.place]
            if there_residual is not None:
                jacobian[:, column.place] = (there_residual - here) / change
            column.take(None if there_residual is None else float(np.linalg.norm(there_residual - here)))
    return jacobian, spent


class _Column:
    """One column of a Jacobian: the coordinate at which its difference is wanted next, until one will do.

    Forwards first, then backwards, then forwards once more: after a failure, where there is no room, and with a
    shorter step where the change was far larger than the data need to see it.
    """

    def __init__(self, place: int, parameter: Parameter, u: float, norm: float, visible: float) -> None:
        self.place = place
        self._u, self._visible = float(u), visible
        self._lower, self._upper = parameter.coordinate(parameter.lower), parameter.coordinate(parameter.upper)
        widest = parameter.difference if parameter.prior else max(parameter.difference, 0.03 * abs(self._u))
        self._smallest = _SMALLEST_STEP * widest
        self._step = widest if norm * widest < visible else max(visible / norm, self._smallest)
        self._signs = [1.0, -1.0, 1.0]
        self.wanted: float | None = None
        self._next()

    def _next(self) -> None:
        self.wanted = None
        while self._signs:
            wanted = float(np.clip(self._u + self._signs.pop(0) * self._step, self._lower, self._upper))
            if abs(wanted - self._u) >= 0.2 * self._step:
                self.wanted = wanted
                return

    def take(self, seen: float | None) -> None:
        """Note by how much the residuals changed (their norm); None for a simulation that failed."""
        if seen is not None and (seen < 5 * self._visible or self._step <= self._smallest):
            self.wanted = None
            return
        if seen is not None:
            self._step = max(self._step * self._visible / seen, self._smallest)
        self._next()


def refit(
    residuals: Residuals,
    space: ParameterSpace,
    start: FloatArray,
    jacobian: FloatArray | None = None,
    budget: int = 120,
    tolerance: float = 2e-3,
) -> Refit | None:
    """Minimise the sum of squares of weighted residuals and priors inside bounds (Levenberg-Marquardt).

    The Jacobian is updated by Broyden's rule after each step and taken afresh when a step fails or when it
    promises nothing more: a fit counts as converged only on a fresh Jacobian.

    Parameters
    ----------
    residuals : callable
        Weighted residuals of candidates.
    space : ParameterSpace
        What to fit.
    start : ndarray of shape (p,)
        Coordinates to start from.
    jacobian : ndarray of shape (n, p), optional
        A Jacobian near the start, to save simulations.
    budget : int
        Simulations at most.
    tolerance : float
        Relative gain in the cost below which the fit has converged.

    Returns
    -------
    Refit or None
        None if the start cannot be simulated.
    """
    lower, upper, prior_weights = space.lowest, space.highest, space.prior_weights
    u = np.clip(np.asarray(start, dtype=np.float64), lower, upper)
    first = residuals([space.at(u)])[0]
    spent = 1
    if first is None:
        return None
    here: FloatArray = first
    fresh = jacobian is None
    if jacobian is None:
        slopes, used = differences(residuals, space, u, here)
        spent += used
    else:
        slopes = jacobian
    damping = 1e-3
    cost = float(here @ here + np.sum((prior_weights * u) ** 2))
    while spent < budget:
        step, promised = linear_step(slopes, here, prior_weights, u, damping, lower, upper)
        enough = promised > tolerance * cost + 1e-2
        if not enough and fresh:
            break
        improved = False
        if enough:
            there = residuals([space.at(u + step)])[0]
            spent += 1
            if there is not None:
                new_cost = float(there @ there + np.sum((prior_weights * (u + step)) ** 2))
                norm = float(step @ step)
                improved = new_cost < cost
                # A rejected step's secant would spoil a fresh Jacobian.
                if norm > 0 and (improved or not fresh):
                    slopes = slopes + np.outer(there - here - slopes @ step, step) / norm
                gain = (cost - new_cost) / promised
            if improved and there is not None:
                u, here, cost, fresh = u + step, there, new_cost, False
                damping = max(damping * (0.2 if gain > 0.6 else 1.0 if gain > 0.2 else 4.0), 1e-7)
        if not improved:
            if fresh:
                damping *= 8.0
                if damping > 1e5:
                    break
                continue
            if spent + len(space) > budget:
                break
            slopes, used = differences(residuals, space, u, here, slopes)
            spent += used
            fresh = True
    # Small steps promise little by being small: what counts is what a full one would.
    _, in_full = linear_step(slopes, here, prior_weights, u, 1e-6, lower, upper)
    promised = in_full if fresh else np.inf
    return Refit(space, u, here, slopes, promised <= max(5 * tolerance * cost, 1e-2), spent, promised=promised)
