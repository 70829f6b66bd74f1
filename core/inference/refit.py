"""Weighted least squares with bounds and priors, from a Jacobian that may be known already."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..parameters import ParameterSpace
from ..trajectory import FloatArray
from .fit_settings import Box, Settings
from .least_squares import LeastSquares, solve

Residuals = Callable[[Sequence[dict[str, float]]], Sequence[FloatArray | None]]
"""Weighted residuals (data minus model, in standard deviations) of candidates that may be simulated side by side; None
for one that cannot be simulated."""

_SETTINGS = Settings(radius=np.inf, noise=0.1, visible=2.0, closer=0.05, ends_on_fresh=True)
"""How every fit of a discovery proceeds (`fit_settings.Settings`).

``radius``: a strength may be 320 probes, and no step is too long. ``visible``, ``closer``: a slope is taken over a
change of twice the noise, and over a tenth of that where a fit is stuck: measured potentials have a kink at every point
of their tables. ``noise``: where a misfit counts as noise, the whole cost is a few squares, and a hundredth of one is
worth a simulation. No steps by an emulator: fits are short and know their Jacobian.
"""

_NO_PRIOR = 1e-10
"""Inverse variance that stands for a missing prior: curvatures stay invertible where no record tells a coordinate."""

_SHARE = 0.03
"""Finite-difference step of a coordinate without a prior, as a share of its size: a strength may be many probes."""


@dataclass(frozen=True, eq=False)
class Refit:
    """Where a fit ended."""

    space: ParameterSpace
    u: FloatArray  # Coordinates of the best candidate; shape (p,).
    residual: FloatArray  # Weighted residuals there, without the priors; shape (n,).
    jacobian: FloatArray  # Derivative of the residual by the coordinates; shape (n, p).
    # Whether a fresh Jacobian promised no further gain; not where none of it could be measured.
    converged: bool
    # The standard deviations that ``residual`` and ``jacobian`` are in, V, where they are known; shape (n,).
    deviation: FloatArray | None = None
    # Fall in cost that a full step predicts on the fresh Jacobian the fit ended with; infinite if it had none.
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
    def fresh(self) -> bool:
        """Whether the Jacobian was measured where the fit ended."""
        return bool(np.isfinite(self.promised))

    @property
    def prior_cost(self) -> float:
        """What the priors add to the cost."""
        return float(np.sum((self.space.prior_weights * self.u) ** 2))

    @property
    def cost(self) -> float:
        """``chi2`` plus ``prior_cost``."""
        return self.chi2 + self.prior_cost

    @property
    def taken(self) -> FloatArray:
        """What the fit has removed from the noise, shape (n, p): ``taken @ taken.T`` is its hat matrix.

        Its trace is the degrees of freedom that the fit has taken: a parameter that its prior holds takes less than
        one.
        """
        weights = np.sqrt(self.curvatures[1])
        return np.asarray(np.linalg.qr(np.vstack([self.jacobian, weights]))[0][: len(self.jacobian)])

    def covariance(self, inflation: float = 1.0, systematic: FloatArray | None = None) -> FloatArray:
        """Covariance of the coordinates (Gauss-Newton), shape (p, p).

        ``inflation`` multiplies the data's variances; ``systematic`` are errors of the residual that do not average
        out, in standard deviations, independent of one another, shape (n, k): each moves the coordinates.
        """
        information, prior = self.curvatures
        covariance = np.linalg.inv(information / inflation + prior)
        if systematic is not None:
            moved = np.linalg.solve(information + prior, self.jacobian.T @ systematic)
            covariance = covariance + moved @ moved.T
        return np.asarray(covariance)

    @property
    def curvatures(self) -> tuple[FloatArray, FloatArray]:
        """What the data and what the priors tell of the coordinates, as inverse covariances, each of shape (p, p)."""
        return self.jacobian.T @ self.jacobian, np.diag(self.space.prior_weights**2 + _NO_PRIOR)


def refit(
    residuals: Residuals,
    space: ParameterSpace,
    start: FloatArray,
    jacobian: FloatArray | None = None,
    budget: int = 120,
    tolerance: float = 2e-3,
    fresh: bool = False,
    slopes: Residuals | None = None,
) -> Refit | None:
    """Minimise the sum of squares of weighted residuals and priors inside bounds; see `LeastSquares`.

    A Jacobian near the start saves simulations; ``fresh`` says that it was measured at the start itself.
    ``tolerance`` is the relative gain in cost below which the fit has converged, and ``slopes`` are residuals by a
    cheaper model, of which Jacobians are taken. None if the start cannot be simulated.
    """
    search = _search(space, start, jacobian, tolerance, fresh=fresh)

    def told(points: Sequence[FloatArray]) -> Sequence[FloatArray | None]:
        if slopes is not None and search.stage == "jacobian":
            return _by_differences(search, slopes, space, points)
        return residuals([space.at(point) for point in points])

    solve(search, told, budget)
    if search.residual is None:
        return None
    jacobian = np.zeros((len(search.residual), len(space))) if search.jacobian is None else search.jacobian
    # A short step gains little because it is short: the gain of a full step decides.
    promised = search.predicted
    converged = promised <= max(5 * tolerance * search.cost, _SETTINGS.noise**2)
    return Refit(space, search.point, search.residual, jacobian, converged, promised=promised)


def _by_differences(
    search: LeastSquares, slopes: Residuals, space: ParameterSpace, points: Sequence[FloatArray]
) -> list[FloatArray | None]:
    """What residuals would be at some points, by how those of a cheaper model differ from its own at the best point."""
    here, *there = slopes([space.at(point) for point in (search.point, *points)])
    known = search.residual
    return [None if here is None or one is None or known is None else known + one - here for one in there]


def slopes_at(residuals: Residuals, fit: Refit) -> FloatArray:
    """The Jacobian where a fit has ended, shape (n, p), taken anew; its own sets the steps."""
    search = _search(fit.space, fit.u, fit.jacobian, 0.0, fit.residual)
    search.renew_jacobian()
    while search.stage == "jacobian":
        search.tell(residuals([fit.space.at(point) for point in search.ask()]))
    assert search.jacobian is not None
    return search.jacobian


def _search(
    space: ParameterSpace,
    start: FloatArray,
    jacobian: FloatArray | None,
    tolerance: float,
    residual: FloatArray | None = None,
    fresh: bool = False,
) -> LeastSquares:
    box = Box(
        space.lowest,
        space.highest,
        space.prior_weights,
        np.array([parameter.difference for parameter in space]),
        np.array([0.0 if parameter.prior else _SHARE for parameter in space]),
    )
    return LeastSquares(start, residual, replace(_SETTINGS, tolerance=tolerance), None, jacobian, box, fresh)
