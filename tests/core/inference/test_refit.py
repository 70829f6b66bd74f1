"""Fits of a discovery: weighted, with priors."""

from collections.abc import Sequence

import numpy as np
import pytest
from bsa.core.inference.refit import refit
from bsa.core.parameters import Candidate, Parameter, ParameterSpace


def test_a_refit_whose_neighbours_all_fail_has_not_converged() -> None:
    space = ParameterSpace((Parameter("a", 1.0, 0.5, 2.0, deviation=0.1, prior=True),))

    def residuals(candidates: Sequence[Candidate]) -> list[np.ndarray | None]:
        return [np.full(50, 3.0) if candidate["a"] == pytest.approx(1.0) else None for candidate in candidates]

    fit = refit(residuals, space, np.zeros(1))
    assert fit is not None
    assert not fit.converged
    assert not fit.fresh
