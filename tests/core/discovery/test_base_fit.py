"""The fit of the base model."""

from dataclasses import replace

import discovery_toy as toy
import numpy as np
from bsa.core.discovery.base_fit import _fit_from_somewhere
from bsa.core.discovery.fitting import Fitter


def test_a_base_fit_also_starts_from_the_charge_that_the_voltage_tells(monkeypatch):
    problem, space = toy.problem(np.random.default_rng(0), {}, held=False)
    problem.misfit_v, as_believed = 1e-3, np.zeros(len(space))
    fitter = Fitter(problem, space, print)
    starts = []

    def fit(effects, start, budget, tolerance):
        starts.append(start)
        # The start that comes nearer ends farther off.
        return replace(Fitter.fit(fitter, effects, start, 1), residual=np.full(3, 9.0 if np.any(start) else 1.0))

    monkeypatch.setattr(fitter, "fit", fit)
    found = _fit_from_somewhere(fitter, as_believed)
    assert len(starts) == 2
    assert np.any(starts[0])
    np.testing.assert_array_equal(found.u, as_believed)
