"""An explanation that was tried: a set of effects with its refit and its judgement."""

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ..comparison.robust_loss import robust
from ..effect import Effect
from ..inference.adequacy import Adequacy
from ..inference.refit import Refit
from ..normal import NORMAL_95, robust_deviation
from ..target import InitialSoc
from ..trajectory import FloatArray

TEMPERATURE_DEVIATION_K = 2.0
"""How well a lumped model's temperature can be expected to agree with a sensor on the can, K."""

CLEAR_K = 1.0
"""A temperature is predicted clearly better where its error is at most half the other's, and this much smaller, K."""

_WITHIN_INTERVAL = 4.0
"""What a step of two standard deviations costs: the half-width of a 95 % interval, squared."""

NEAR_V = 2e-3
"""A typical error below which a fit is near enough to be weighed against the noise, V."""


@dataclass(frozen=True)
class Estimate:
    """A fitted effect parameter."""

    name: str
    unit: str
    value: float
    # Its 95 % interval, Gauss-Newton, widened for the dispersion of the residual and for errors that are systematic.
    ci95: tuple[float, float]
    null: float  # Its null value.
    at_bound: bool  # Whether the fit stopped at a bound: the value then says little.
    of: tuple[float, str] = (1.0, "")  # As in `EffectParameter`.

    @property
    def physical(self) -> tuple[float, tuple[float, float], str]:
        """Value, 95 % interval, and the unit that both are in."""
        times, unit = self.of
        return times * self.value, (times * self.ci95[0], times * self.ci95[1]), self.unit or unit

    def to_json(self) -> dict[str, Any]:
        """Its part of ``discovery.json``; ``physical`` is what a pure number stands for."""
        value, ci95, unit = self.physical
        content = {name: entry for name, entry in asdict(self).items() if name != "of"}
        return content | {"physical": {"value": value, "ci95": ci95, "unit": unit}}

    @property
    def holds_null(self) -> bool:
        """Whether the null value lies in the interval."""
        low, high = self.ci95
        return low <= self.null <= high


@dataclass(eq=False)
class Explanation:
    """A set of effects fitted jointly with the base parameters."""

    effects: tuple[Effect, ...]  # What was added; empty for the base model.
    fit: Refit
    adequacy: Adequacy  # Whether it leaves noise only.
    rmse_v: float  # Root mean square error over the samples of the fitted records, V.
    held_rmse_v: float  # The same over data not fitted, V; infinite where there is none, or one failed.
    # errors, sigma: Errors of the fitted stretches and their standard deviations, V, without any misfit; shape (n,).
    errors: FloatArray
    sigma: FloatArray
    # Error of the predicted temperature, K, where the records have one; no fit is shown it.
    temperature_rms_k: float | None = None
    # By effect key, the same error with that effect's strength at its null, where its interval holds that.
    temperature_without_k: dict[str, float] = field(default_factory=dict)
    estimates: dict[str, tuple[Estimate, ...]] = field(default_factory=dict)  # By effect key, its parameters.
    # Of each hold-out record, measured minus predicted, V; none if one failed.
    held_errors: tuple[FloatArray, ...] = ()
    taken_off: int = 0  # Degrees of freedom that the errors had lost before the fit, as to means taken off them.

    def chi2(self, misfit_v: float = 0.0) -> float:
        """Sum of squares, as a fit weighs them, with a misfit (V) added in quadrature to the deviations."""
        return float(np.sum(robust(self.errors) ** 2 / (self.sigma**2 + misfit_v**2)))

    def dispersion(self, misfit_v: float) -> float:
        """Sum of squares over degrees of freedom, times the variance inflation of correlated neighbours; 1 or more."""
        return self._dispersion(self.chi2(misfit_v))

    def _dispersion(self, squares: float) -> float:
        freedom = max(len(self.errors) - len(self.fit.space) - self.taken_off, 1)
        return max(1.0, squares / freedom * self.adequacy.variance_inflation)

    @property
    def settled(self) -> bool:
        """Whether its fit has converged, or ended where all that slopes promise lies inside the parameters' intervals.

        Where a model does not come down to the noise, costs are counted in units of their dispersion: a promise
        of a few such units moves no parameter beyond what is uncertain about it.
        """
        return self.fit.converged or self.fit.promised <= _WITHIN_INTERVAL * self._dispersion(self.fit.chi2)

    @property
    def misfit_v(self) -> float:
        """A typical error beyond noise, V: not affected by the few averages that are far off."""
        typical = robust_deviation(self.errors) ** 2
        return float(np.sqrt(max(typical - float(np.median(self.sigma**2)), 0.0)))

    @property
    def inflated_noise_v(self) -> float:
        """The misfit with which each average is weighed where neighbours are correlated, V.

        ``n`` averages with the same error are one piece of evidence. With ``sqrt(n)`` times the misfit each, they weigh
        as much against the priors as a single one.
        """
        return self.misfit_v * float(np.sqrt(self.adequacy.variance_inflation))

    @property
    def counts_as_noise_v(self) -> float:
        """The misfit that a fit from here counts as noise, V: none where a model is near, for it may prove adequate."""
        return self.inflated_noise_v if self.misfit_v > NEAR_V else 0.0

    @property
    def cost(self) -> float:
        """What its fit left, with the temperature: by this explanations that are fitted side by side are compared."""
        return self.fit.cost + temperature_misfit(self.temperature_rms_k)

    @property
    def names(self) -> tuple[str, ...]:
        """Public names of the effects, sorted; variants of one effect share a name."""
        return tuple(sorted({effect.name for effect in self.effects}))

    @property
    def label(self) -> str:
        """The effects in words."""
        return " + ".join(effect.key for effect in self.effects) or "base model"

    @property
    def beyond_window(self) -> dict[str, float]:
        """Initial states of charge, by name, below the empty or above the full cell of the parameter set."""
        states = {p.name: self.fit.candidate[p.name] for p in self.fit.space if isinstance(p.target, InitialSoc)}
        return {name: float(soc) for name, soc in states.items() if not 0.0 <= soc <= 1.0}

    def excludes_null(self, clear_k: float = CLEAR_K) -> bool:
        """Whether each effect's strength stays off its far bound and has an interval without its null value.

        Where that interval, which the voltage gives, holds the null, the temperature may exclude it: without the
        effect it is predicted clearly worse.
        """
        for effect in self.effects:
            strength = self.estimates[effect.key][0]
            told = clearly_nearer(self.temperature_rms_k, self.temperature_without_k.get(effect.key), clear_k)
            if strength.at_bound or (strength.holds_null and not told):
                return False
        return True


def clearly_nearer(ours_k: float | None, theirs_k: float | None, clear_k: float = CLEAR_K) -> bool:
    """Whether one error of a temperature is clearly below another, K; never where none was measured."""
    return ours_k is not None and theirs_k is not None and 2 * ours_k <= theirs_k and ours_k + clear_k <= theirs_k


def temperature_misfit(temperature_rms_k: float | None, deviation_k: float = TEMPERATURE_DEVIATION_K) -> float:
    """Squared error of a temperature (K), as one observation; 0 where none was measured."""
    return ((temperature_rms_k or 0.0) / deviation_k) ** 2


def estimates_of(
    effects: tuple[Effect, ...], fit: Refit, dispersion: float, systematic: FloatArray | None = None
) -> dict[str, tuple[Estimate, ...]]:
    """The effects' parameters with their intervals; the other arguments are those of `Refit.covariance`."""
    deviations: FloatArray = np.sqrt(np.diag(fit.covariance(dispersion, systematic)))
    place = {name: number for number, name in enumerate(fit.space.names)}
    result: dict[str, tuple[Estimate, ...]] = {}
    for effect in effects:
        rows = []
        for p in effect.parameters:
            number = place[effect.full_name(p)]
            parameter, u = fit.space.parameters[number], float(fit.u[number])
            half = NORMAL_95 * float(deviations[number])
            if p.scale == "log":
                ends = [parameter.origin * np.exp(end * parameter.length) for end in (u - half, u + half)]
            else:
                ends = [parameter.origin + end * parameter.length for end in (u - half, u + half)]
            value = parameter.at_coordinate(u)
            bound = {"lower": p.lower, "upper": p.upper}.get(parameter.bound_at(value), p.null)
            interval = float(ends[0]), float(ends[1])
            rows.append(Estimate(p.name, p.unit, value, interval, p.null, bound != p.null, p.of))
        result[effect.key] = tuple(rows)
    return result
