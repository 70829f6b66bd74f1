"""Paired comparisons of methods over cases: a difference is claimed only where it holds."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...core.printable import counted
from ...core.trajectory import FloatArray
from .summary import Row, geometric_mean, grouped

LEVEL = 0.05
FEWEST_CASES = 6
"""With fewer pairs the signed-rank test cannot reach the level, however clear the difference."""

FLOOR = 1e-3
"""Errors below this count as this (% MAPE or mV): nobody can measure what lies under it, and its ratios explode."""

_RESAMPLES = 10_000
_SEED = 20_260


@dataclass(frozen=True)
class Comparison:
    """A method against the reference, case by case."""

    # method, reference: What is compared.
    method: str
    reference: str
    cases: int  # Pairs; seeds of a case are averaged (geometric mean) before it is paired, for they are not new cases.
    missing: int  # Cases in which one of them has no result.
    ratio: float  # Geometric mean of the method's error over the reference's: 2 is twice the error.
    # low, high: Bootstrap interval of the ratio, 95 %, over cases (bias-corrected).
    low: float
    high: float
    # worse, better: Cases in which the method's error is larger, smaller.
    worse: int
    better: int
    p: float  # Two-sided Wilcoxon signed-rank test on the logarithms.
    adjusted_p: float  # The same after Holm's correction for all comparisons of its family.

    @property
    def holds(self) -> bool:
        """Whether a difference may be claimed: test and interval agree, and no case is missing."""
        return (
            self.missing == 0
            and self.cases >= FEWEST_CASES
            and self.adjusted_p < LEVEL
            and not self.low <= 1.0 <= self.high
        )

    @property
    def verdict(self) -> str:
        """The comparison in words."""
        if self.holds:
            return "larger error" if self.ratio > 1 else "smaller error"
        if self.cases + self.missing < FEWEST_CASES:
            return f"too few cases ({self.cases}) to tell"
        if self.missing:
            return f"not claimed: {counted(self.missing, 'case')} without a result"
        return "no difference shown"


def by_case(rows: Sequence[Row], metric: str = "objective") -> dict[str, dict[str, float]]:
    """Errors by method and case: the geometric mean over seeds; NaN where a seed has no result."""
    return {
        method: {
            case: geometric_mean(np.maximum(np.array([row[metric] for row in seeds], float), FLOOR))
            for case, seeds in grouped(own, "task").items()
        }
        for method, own in grouped(rows, "method").items()
    }


def compare(rows: Sequence[Row], reference: str, metric: str = "objective") -> list[Comparison]:
    """Every method against a reference."""
    errors = by_case(rows, metric)
    if reference not in errors:
        return []
    found = [_paired(method, reference, errors) for method in errors if method != reference]
    adjusted = holm([comparison.p for comparison in found])
    return [replace(comparison, adjusted_p=p) for comparison, p in zip(found, adjusted, strict=True)]


def _paired(method: str, reference: str, errors: Mapping[str, Mapping[str, float]]) -> Comparison:
    shared = [case for case in errors[reference] if case in errors[method]]
    logs = np.array([math.log(errors[method][case] / errors[reference][case]) for case in shared])
    known = logs[np.isfinite(logs)]
    low, high = bootstrap(known)
    return Comparison(
        method=method,
        reference=reference,
        cases=len(known),
        missing=len(logs) - len(known),
        ratio=math.exp(float(np.mean(known))) if len(known) else math.nan,
        low=math.exp(low),
        high=math.exp(high),
        worse=int(np.sum(known > 0)),
        better=int(np.sum(known < 0)),
        p=wilcoxon(known),
        adjusted_p=math.nan,
    )


def wilcoxon(differences: FloatArray) -> float:
    """Two-sided p of the signed-rank test; 1 where all pairs are equal or there is none."""
    from scipy import stats

    if not np.any(np.abs(differences) > 0):
        return 1.0
    result: Any = stats.wilcoxon(differences, zero_method="pratt", method="auto")
    return float(result.pvalue)


def bootstrap(values: FloatArray) -> tuple[float, float]:
    """Bias-corrected and accelerated interval of the mean; the same numbers give the same interval."""
    if len(values) < 2 or np.ptp(values) == 0.0:
        only = float(values[0]) if len(values) else math.nan
        return only, only
    from scipy import stats

    result = stats.bootstrap(
        (values,), np.mean, confidence_level=1 - LEVEL, n_resamples=_RESAMPLES, rng=np.random.default_rng(_SEED)
    ).confidence_interval
    return float(result.low), float(result.high)


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's step-down correction for several comparisons."""
    known = np.array(p_values)
    order = np.argsort(known, kind="stable")
    adjusted = np.empty(len(known))
    adjusted[order] = np.maximum.accumulate(np.arange(len(known), 0, -1) * known[order])
    return [float(p) for p in np.minimum(adjusted, 1.0)]
