"""A stage on open-circuit data: fitted to a cell at equilibrium, which every simulation corrects.

The parameters of the open-circuit curve act on a slow record nearly as they do on a cell at equilibrium, whose voltage
takes milliseconds. What the two differ by, a polarisation that hardly depends on these parameters, is taken from the
simulation of the best point and held while the cell at equilibrium is fitted. The simulation of what was found corrects
it anew. Alexandrov & Lewis, Optim. Eng. 2 (2001) 413 (a cheaper model with an additive correction); Bandler et al.,
IEEE Trans. Microw. Theory Tech. 52 (2004) 337 (space mapping).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm, qmc

from ...core.comparison.residuals import residuals
from ...core.inference.least_squares import LeastSquares, solve
from ...core.parameters import Candidate
from ...core.simulation import Outcome
from ...core.trajectory import FloatArray
from ...core.trial import Trial
from .stage_fit import SETTINGS, Stage

_SETTINGS = replace(SETTINGS, emulates=False, visible=0.3)
"""Those of a stage, but for the emulator: a cell at equilibrium costs less than what it would learn from it. Slopes are
taken over 0.3 standard deviations of the misfit, 3 mV at first: at the knee of a discharge 1.5 % of capacity, a tenth
of its prior, changes the voltage by 25 mV rms, and a slope over that is none of the point's."""

Equilibrium = Callable[[Sequence[Candidate]], Sequence[Outcome] | None]

_EVALUATIONS = 1000
"""Cells at equilibrium that a fit between two simulations may compute: some thirty Jacobians."""

_DRAWS = 256
"""Cells drawn from the priors where the start runs empty or full: of these some hold the charge that was drawn."""

_STARTS = 4
"""The best of them, from which fits begin."""

_HALVINGS = 3
"""Times that a step is halved when its simulation is worse than the one before: an eighth of what the equilibrium
promises is not worth a simulation."""


@dataclass(eq=False)
class EquilibriumFit(Stage):
    """A stage that simulates only the ends of fits to a cell at equilibrium, ``equilibrium`` of `ProposeContext`."""

    equilibrium: Equilibrium

    def __post_init__(self) -> None:
        super().__post_init__()
        self._tried_bare = False  # Whether a fit without a correction was tried.
        self._corrected = False  # Whether the fit whose end is asked for had one.
        self._next: FloatArray | None = None
        self._rejected = 0

    def ask(self, simulations_left: int) -> list[Candidate]:
        """See `Stage.ask`: the end of the next fit, if it promises something."""
        if min(self.left, simulations_left) <= 0:
            return []
        if self._next is None or self._rejected > _HALVINGS:
            self._next, self._rejected = self._another(), 0
        return [] if self._next is None else [self._space.at(self._next)]

    def tell(self, trials: Sequence[Trial]) -> Trial:
        """See `Stage.tell`."""
        (trial,) = trials
        assert self._next is not None
        self.left -= 1
        if self._cost(self._weighed(trial), self._next) < self._cost(self._weighed(self.here), self._point(self.here)):
            self.here, self._next, self._rejected = trial, None, 0
            self.noise = self._misfit_noise()
        else:
            self._next, self._rejected = 0.5 * (self._next + self._point(self.here)), self._rejected + 1
        return self.here

    @property
    def _method(self) -> str:
        return "the end of a fit to a cell at equilibrium, corrected by the last simulation"

    def _another(self) -> FloatArray | None:
        """The end of another fit; None where none is left that promises something.

        Where the last simulation ran empty or full, the cell at equilibrium is first fitted without a correction, once:
        what the two differ by is then no polarisation. Held, volts where the cell was empty, it can make every other
        balance of the electrodes look worse.
        """
        if self.here.limits and not self._tried_bare:
            self._tried_bare, self._corrected = True, False
            found = self._fitted(corrected=False)
            if found is not None:
                return found
        elif self._corrected and self._rejected > _HALVINGS:
            return None
        self._corrected = True
        return self._fitted()

    def _fitted(self, corrected: bool = True) -> FloatArray | None:
        """Where the (corrected) cell at equilibrium fits best; None where that gains next to nothing."""
        here = self._at_equilibrium([self._point(self.here)])[0]
        seen = self._weighed(self.here)
        if here is None or seen is None:
            return None
        correction = seen - here if corrected else np.zeros_like(seen)

        def shifted(points: list[FloatArray]) -> list[FloatArray | None]:
            return [None if found is None else found + correction for found in self._at_equilibrium(points)]

        before = self._cost(here + correction, self._point(self.here))
        starts = [self._point(self.here)] if corrected else self._drawn()
        searches = []
        for start, residual in zip(starts, shifted(starts), strict=True):
            searches.append(LeastSquares(start, residual, _SETTINGS, self._free, box=self._box()))
            solve(searches[-1], shifted, _EVALUATIONS)
        best = min(searches, key=lambda search: search.cost)
        gained = before - best.cost
        return best.point if gained > max(SETTINGS.noise**2, SETTINGS.tolerance * before) else None

    def _drawn(self) -> list[FloatArray]:
        """The start, and the cells at equilibrium that fit best of many drawn from the priors.

        From a cell that is empty before its record ends no derivative leads to one that is not: a fit bends the
        potentials instead.
        """
        start = self._point(self.here)
        spread = self._free & (self._space.prior_weights > 0.0)
        drawn = start + spread * norm.ppf(qmc.Sobol(len(start), seed=0).random(_DRAWS))
        points = list(np.clip(drawn, self._space.lowest, self._space.highest))
        costs = [self._cost(found, point) for found, point in zip(self._at_equilibrium(points), points, strict=True)]
        return [start, *(points[place] for place in np.argsort(costs)[: _STARTS - 1])]

    def _at_equilibrium(self, points: Sequence[FloatArray]) -> list[FloatArray | None]:
        """The view's residuals of a cell at equilibrium, in standard deviations."""
        outcomes = self.equilibrium([self._space.at(point) for point in points])
        assert outcomes is not None  # it was there when the stage began
        found = [residuals(self.task, outcome) for outcome in outcomes]
        return [None if values is None else self.view(values) / self.noise for values in found]

    def _cost(self, residual: FloatArray | None, point: FloatArray) -> float:
        prior = self._space.prior_weights * point
        return np.inf if residual is None else float(residual @ residual + prior @ prior)
