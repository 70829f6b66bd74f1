"""An emulator of the residuals near a fit: a Gaussian process through all simulations, which estimates its own error.

References
----------
Kennedy & O'Hagan, J. R. Stat. Soc. B 63 (2001) 425. Rasmussen & Williams, Gaussian Processes for Machine Learning
(2006), Ch. 2 and 5.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, cholesky, eigh, qr, solve_triangular
from scipy.optimize import minimize

from ..trajectory import FloatArray

_LENGTHS = (0.05, 20.0)
"""Length scales that are possible, in units of the box."""

_USUAL_LENGTH, _SPREAD = 0.7, 0.8
"""Median of the length scales before anything is seen, and the standard deviation of their logarithm: responses bend
over about the searched range, and hardly ever over a tenth or ten times as much."""

_NUGGETS = (1e-9, 1e-2)
"""Possible variances of the integrator's own error, as shares of a component's variance."""

_LINEAR = 100.0
"""Prior variance of the linear part of a response relative to its curved part: so large that it restrains nothing."""

_LEFT_OUT = 0.03
"""Root mean square that the components left out may have, in units of one deviation plus a simulation's own misfit."""

_LEADING = 6
"""Components from which length scales are learnt: those after them are small, or the integrator's error."""


@dataclass(frozen=True, eq=False)
class Emulator:
    """Residuals as a function of the place in the unit box, in units of their standard deviation."""

    points: FloatArray  # Where simulations were made. Shape (n, p).
    best: FloatArray  # Residuals of the best of them. Shape (m,).
    rows: FloatArray  # The components' directions, orthonormal. Shape (r, m).
    lengths: FloatArray  # Length scales. Shape (p,).
    nugget: float  # Variance of the integrator's error, as a share of a component's.
    factor: FloatArray  # Lower Cholesky factor of the kernel's matrix. Shape (n, n).
    weights: FloatArray  # The inverse of that matrix times the components. Shape (n, r).
    amplitudes: FloatArray  # Variance of each component. Shape (r,).

    def predict(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and variance of the components at points of shape (k, p), each of shape (k, r)."""
        curved, linear = _kernels(points, self.points, self.lengths)
        across = curved + linear
        solved = solve_triangular(self.factor, across.T, lower=True, check_finite=False)
        alone = 1.0 + _LINEAR * (1.0 + np.sum((points - _MIDDLE) ** 2, axis=1))
        share = np.maximum(alone - np.sum(solved**2, axis=0), 0.0)
        return self._inside + across @ self.weights, share[:, None] * self.amplitudes

    def expected_cost(self, point: FloatArray) -> tuple[float, FloatArray]:
        """Expected sum of squared residuals at a point of shape (p,), and its derivatives of shape (p,).

        The emulator's own variance is part of it: a point of which it knows little is not expected to be good.
        """
        curved, linear = _kernels(point[None, :], self.points, self.lengths)
        across, slopes = (curved + linear)[0], self._slopes(point, curved)
        mean = self._inside + across @ self.weights
        solved = cho_solve((self.factor, True), across, check_finite=False)
        alone = 1.0 + _LINEAR * (1.0 + float(np.sum((point - _MIDDLE) ** 2)))
        total = float(np.sum(self.amplitudes))
        share = alone - float(across @ solved)
        value = self.beyond + float(mean @ mean) + max(share, 0.0) * total
        slope = 2.0 * (slopes.T @ (self.weights @ mean))
        if share > 0.0:
            slope = slope + 2.0 * total * (_LINEAR * (point - _MIDDLE) - slopes.T @ solved)
        return value, slope

    def derivatives(self, point: FloatArray) -> FloatArray:
        """Derivatives of the likeliest residuals at a point of shape (p,), shape (m, p)."""
        curved, _ = _kernels(point[None, :], self.points, self.lengths)
        return np.asarray(self.rows.T @ (self.weights.T @ self._slopes(point, curved)))

    def _slopes(self, point: FloatArray, curved: FloatArray) -> FloatArray:
        """Derivatives of the prior covariances between a point and those simulated by its coordinates, shape (n, p)."""
        return np.asarray(
            curved[0][:, None] * (self.points - point) / self.lengths**2 + _LINEAR * (self.points - _MIDDLE)
        )

    @cached_property
    def beyond(self) -> float:
        """Sum of squares of the best residuals outside the components: the same at every point."""
        return float(self.best @ self.best - self._inside @ self._inside)

    @cached_property
    def _inside(self) -> FloatArray:
        """Components of the best residuals, shape (r,)."""
        return np.asarray(self.rows @ self.best)

    def residuals(self, points: FloatArray) -> FloatArray:
        """The likeliest residuals at points of shape (k, p), shape (k, m)."""
        return np.asarray(self.best + (self.predict(points)[0] - self._inside) @ self.rows)

    def cost_function(self, dispersion: float = 1.0) -> Callable[[FloatArray], FloatArray]:
        """Twice the negative logarithm of the likelihood at points of shape (k, p), but for a constant.

        The emulator's own error counts as further noise: where nothing was simulated, little is ruled out.
        """

        def cost(points: FloatArray) -> FloatArray:
            mean, variance = self.predict(points)
            wide = 1.0 + variance / dispersion
            return np.asarray(np.sum(mean**2 / (dispersion * wide) + np.log(wide), axis=1))

        return cost


_MIDDLE = 0.5
"""Middle of the unit box, about which the linear part of a response is defined."""


def learn(points: FloatArray, residuals: FloatArray, earlier: Emulator | None = None) -> Emulator:
    """An emulator of simulations at points of shape (n, p) that gave residuals of shape (n, m).

    ``earlier`` is one of fewer simulations, whose length scales are a good start.
    """
    best = int(np.argmin(np.sum(residuals**2, axis=1)))
    changes = residuals - residuals[best]
    # Where the misfit is large, a part of it matters as little as a part of one deviation does at the best point.
    tolerated = 1.0 + np.sqrt(np.mean(residuals**2, axis=1))
    rows = _leading_rows(changes / tolerated[:, None])
    components = changes @ rows.T
    start = np.append(np.log(np.full(points.shape[1], _USUAL_LENGTH)), np.log(1e-6))
    if earlier is not None:
        start = np.append(np.log(earlier.lengths), np.log(earlier.nugget))
    found = _learnt_scales(points, components[:, :_LEADING], tolerated, start)
    lengths, nugget = np.exp(found[:-1]), float(np.exp(found[-1]))
    curved, linear = _kernels(points, points, lengths)
    factor = cholesky(curved + linear + np.diag(nugget * tolerated**2), lower=True, check_finite=False)
    weights = cho_solve((factor, True), components, check_finite=False)
    # A linear model through the points costs as many degrees of freedom as it has coefficients.
    freedom = max(len(points) - points.shape[1] - 1, 1)
    amplitudes = np.maximum(np.sum(components * weights, axis=0) / freedom, 1e-12)
    return Emulator(points, residuals[best], rows, lengths, nugget, factor, weights, amplitudes)


def _leading_rows(changes: FloatArray) -> FloatArray:
    """Orthonormal rows that span all but a small rest, the leading ones first.

    Of some hundred simulations with thousands of residuals each, the eigenvectors of the products are had in a tenth of
    the time of a singular value decomposition.
    """
    squares, mixes = eigh(changes @ changes.T, check_finite=False)
    squares, mixes = np.maximum(squares[::-1], 0.0), mixes[:, ::-1]
    rest = np.sqrt(np.append(np.cumsum(squares[::-1])[::-1][1:], 0.0) / len(changes))
    spanning = mixes[:, : int(np.argmax(rest <= _LEFT_OUT)) + 1].T @ changes
    return np.asarray(qr(spanning.T, mode="economic", check_finite=False)[0].T)


def _learnt_scales(points: FloatArray, components: FloatArray, tolerated: FloatArray, start: FloatArray) -> FloatArray:
    """Logarithms of the length scales and the nugget that are likeliest given the components of shape (n, r)."""
    count, outputs = components.shape
    middle = points - np.mean(points, axis=0)

    def apart(shares: FloatArray) -> FloatArray:
        """Squared distances of all pairs of points, by coordinate, summed with symmetric shares of shape (n, n)."""
        return np.asarray(2.0 * (np.sum(shares, axis=1) @ middle**2 - np.sum(middle * (shares @ middle), axis=0)))

    def misfit(log: FloatArray) -> tuple[float, FloatArray]:
        lengths = np.exp(log[:-1])
        curved, linear = _kernels(points, points, lengths)
        noise = np.exp(log[-1]) * tolerated**2
        factor = cholesky(curved + linear + np.diag(noise), lower=True, check_finite=False)
        weights = cho_solve((factor, True), components, check_finite=False)
        powers = np.maximum(np.sum(components * weights, axis=0), 1e-12)
        off = (log[:-1] - np.log(_USUAL_LENGTH)) / _SPREAD
        value = 0.5 * count * np.sum(np.log(powers)) + outputs * np.sum(np.log(np.diag(factor))) + 0.5 * off @ off
        inverse = cho_solve((factor, True), np.eye(count), check_finite=False)
        steer = 0.5 * outputs * inverse - 0.5 * count * (weights / powers) @ weights.T
        slopes = apart(steer * curved) / lengths**2 + off / _SPREAD
        return float(value), np.append(slopes, np.sum(np.diag(steer) * noise))

    bounds = [tuple(np.log(_LENGTHS))] * points.shape[1] + [tuple(np.log(_NUGGETS))]
    return np.asarray(minimize(misfit, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 40}).x)


def _kernels(one: FloatArray, other: FloatArray, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Prior covariances between points, relative to the amplitudes: of the curved part, and of the linear one."""
    a, b = one / lengths, other / lengths
    squares = np.sum(a**2, axis=1)[:, None] + np.sum(b**2, axis=1) - 2.0 * (a @ b.T)
    linear = _LINEAR * (1.0 + (one - _MIDDLE) @ (other - _MIDDLE).T)
    return np.exp(-0.5 * np.maximum(squares, 0.0)), linear
