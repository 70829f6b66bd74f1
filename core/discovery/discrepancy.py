r"""What a model lacks as a random process: an Ornstein-Uhlenbeck discrepancy beside the noise, and its likelihood.

The error of a model is ``e = delta + epsilon``: independent noise of known deviations, and a discrepancy with the
covariance :math:`s^2 \exp(-|t - t'| / \tau)` within a record and none between records. It is Markov, so that its
inverse covariance is tridiagonal whatever the sampling, and a likelihood of ``n`` errors costs ``O(n)`` (Rasmussen and
Williams 2006, appendix B; for models with a discrepancy Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.optimize import minimize

from ..trajectory import FloatArray

CLEAR = float(np.log(100.0))
"""Log odds from which a discrepancy is told from noise: noise alone reaches them in 1 % of cases, for with a scale and
a correlation time twice the log odds are chi-square with two degrees of freedom at most (Wilks 1938)."""

REACH = 1.0
"""Deviations (of a prior, or the visible size of a coordinate) up to which errors count as linear in one. A fit that
weighed neighbours as if they were independent has ended beside the likeliest parameters."""

_CLOSEST = 1e-6
"""Share of the correlation time below which two times count as that far apart: a step's stamps may be equal."""

_UNKNOWN = 1e-10
"""Precision of a coordinate with a flat prior, so that one which no error depends on has a variance."""

_STARTS = (0.01, 0.1, 1.0)
"""Correlation times from which the likelihood is climbed, as shares of the longest record."""


@dataclass(frozen=True)
class Discrepancy:
    """Scale and correlation time of a discrepancy.

    Attributes
    ----------
    scale_v : float
        Its standard deviation ``s``, V; 0 for none.
    time_s : float
        Its correlation time ``tau``, s.
    """

    scale_v: float = 0.0
    time_s: float = 1.0


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors of a model with their noise, and how they move with its parameters.

    Attributes
    ----------
    times : sequence of ndarray
        By record: when, s, in order.
    values : ndarray of shape (n,)
        Errors of all records, one after the other, V.
    sigma : ndarray of shape (n,)
        Standard deviations of their noise, V.
    jacobian : ndarray of shape (n, p)
        Derivatives of the errors by the parameters' coordinates, V.
    u : ndarray of shape (p,)
        Coordinates at which the errors are.
    prior_weights : ndarray of shape (p,)
        Inverse deviations of the coordinates' normal priors around 0; 0 where a prior is flat.
    shared : int
        How many of the first coordinates are those of every model that is compared.
    """

    times: Sequence[FloatArray]
    values: FloatArray
    sigma: FloatArray
    jacobian: FloatArray
    u: FloatArray
    prior_weights: FloatArray
    shared: int

    def log_evidence(self, discrepancy: Discrepancy) -> float:
        r"""Logarithm of the marginal likelihood, the parameters integrated out as if the errors were linear in them.

        .. math:: -\frac12 [\min_d q(d) + \ln|S| + n \ln 2\pi + \ln|J^T S^{-1} J + B| - \ln|B|]

        with ``q`` the sum of squares of errors and priors at a step ``d`` and ``B`` the priors' precision. A flat
        prior has the density 1 per coordinate and no place in ``B``. The step is `REACH` at most, in the shared
        coordinates: what a fit that has not ended promises is no evidence for it.
        """
        normal, slope, squares, log_det = self._normal(discrepancy)
        factor = np.linalg.cholesky(normal)
        step = -np.linalg.solve(normal[: self.shared, : self.shared], slope[: self.shared])
        share = min(1.0, REACH / max(float(np.max(np.abs(step), initial=0.0)), 1e-300))
        least = squares + share * (2 - share) * float(slope[: self.shared] @ step)
        known = self.prior_weights[self.prior_weights > 0]
        log_det += 2 * float(np.sum(np.log(np.diag(factor))) - np.sum(np.log(known)))
        # Each flat prior takes one of the 2 pi with it.
        free = len(self.values) - len(self.u) + len(known)
        return -0.5 * float(least + log_det + free * np.log(2 * np.pi))

    def covariance(self, discrepancy: Discrepancy) -> FloatArray:
        """Covariance of the coordinates, shape (p, p), with the discrepancy beside the noise."""
        return np.asarray(np.linalg.inv(self._normal(discrepancy)[0]))

    def _normal(self, discrepancy: Discrepancy) -> tuple[FloatArray, FloatArray, float, float]:
        """Normal matrix and slopes of the coordinates, the sum of squares with the priors, and ``ln|S|``."""
        columns = np.column_stack([self.values, self.jacobian])
        solved, log_det = self._solve(columns, discrepancy)
        products = columns.T @ solved
        weights = self.prior_weights**2
        normal = products[1:, 1:] + np.diag(weights + _UNKNOWN)
        return normal, products[1:, 0] + weights * self.u, float(products[0, 0] + weights @ self.u**2), log_det

    def _solve(self, columns: FloatArray, discrepancy: Discrepancy) -> tuple[FloatArray, float]:
        """Covariance of the errors, inverted, times some columns, and the logarithm of its determinant."""
        variance = self.sigma**2
        precision, log_det_precision = self._precision(discrepancy.time_s)
        # Woodbury: (s^2 Q^-1 + D)^-1 = D^-1 - D^-1 s^2 (Q + s^2 D^-1)^-1 D^-1 with Q tridiagonal and D the noise.
        precision[1] += discrepancy.scale_v**2 / variance
        factor = cholesky_banded(precision)
        weighed = columns / variance[:, None]
        solved = weighed - discrepancy.scale_v**2 * cho_solve_banded((factor, False), weighed) / variance[:, None]
        return solved, float(np.sum(np.log(variance)) + 2 * np.sum(np.log(factor[1]))) - log_det_precision

    def _precision(self, time_s: float) -> tuple[FloatArray, float]:
        """Inverse correlation of the discrepancy in upper banded form, shape (2, n), and its log determinant."""
        bands = []
        log_det = 0.0
        for time in self.times:
            steps = np.maximum(np.diff(time) / time_s, _CLOSEST)
            kept, lost = np.exp(-steps), -np.expm1(-2 * steps)  # of a deviation, and of the variance, in each step
            diagonal = np.ones(len(time))
            diagonal[1:] += kept**2 / lost
            diagonal[:-1] += kept**2 / lost
            bands.append(np.vstack([np.append(0.0, -kept / lost), diagonal]))
            log_det -= float(np.sum(np.log(lost)))
        return np.hstack(bands), log_det

    def likeliest(self) -> tuple[Discrepancy, float]:
        """The discrepancy with the highest evidence (restricted maximum likelihood), and that log evidence.

        None (a scale of 0) where it is not `CLEAR` that there is one. Correlation times are searched from the typical
        step between errors to ten times the longest record.
        """
        longest = max(float(np.ptp(time)) for time in self.times)
        shortest = float(np.median(np.concatenate([np.diff(time) for time in self.times])))
        typical = float(np.sqrt(np.mean(self.values**2)))
        bounds = [(np.log(1e-3 * typical), np.log(1e2 * typical)), (np.log(shortest), np.log(10 * longest))]

        def cost(logs: FloatArray) -> float:
            return -self.log_evidence(Discrepancy(*np.exp(logs)))

        starts = [(np.log(typical), np.clip(np.log(share * longest), *bounds[1])) for share in _STARTS]
        best = min((minimize(cost, start, bounds=bounds, method="L-BFGS-B") for start in starts), key=lambda f: f.fun)
        noise_alone = self.log_evidence(Discrepancy())
        if -best.fun - noise_alone < CLEAR:
            return Discrepancy(), noise_alone
        return Discrepancy(*(float(value) for value in np.exp(best.x))), -float(best.fun)
