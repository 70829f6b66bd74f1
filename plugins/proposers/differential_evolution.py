"""Differential evolution by SciPy, on one number or on a weighted sum of the errors of each signal."""

from collections.abc import Callable, Sequence

import numpy as np
from pydantic import BaseModel, Field
from scipy.optimize import differential_evolution

from ...core.comparison.paper_metrics import require_paper
from ...core.hooks import ProposeContext, RunContext, hookimpl
from ...core.proposal import Proposal
from ...core.trajectory import FloatArray
from ...core.trial import Trial
from .trial_errors import errors_by_round

_GENERATIONS = 10_000
"""More than any budget of simulations holds."""


class DifferentialEvolutionOptions(BaseModel, extra="forbid"):
    """Settings of `scipy.optimize.differential_evolution`."""

    population: int = Field(
        2, ge=1, description="Candidates a generation, per parameter. SciPy's 15 would spend the budget on one."
    )
    strategy: str = Field("best1bin", description="Mutation strategy, by SciPy's name.")
    mutation: tuple[float, float] = Field((0.5, 1.0), description="Range of the differential weight.")
    recombination: float = Field(0.7, ge=0, le=1, description="Crossover probability.")


class WeightedDifferentialEvolutionOptions(DifferentialEvolutionOptions):
    """The same, and the weights of the sum."""

    q_weight: float = Field(1.0, ge=0, description="Weight of the charge's error, relative to its first value.")
    i_weight: float = Field(1.0, ge=0, description="Weight of the current's error, relative to its first value.")
    v_weight: float = Field(1.0, ge=0, description="Weight of the voltage's error, relative to its first value.")


class _Question(Exception):
    """The first population whose errors are not known yet, shape (n, p)."""

    def __init__(self, population: FloatArray) -> None:
        super().__init__()
        self.population = population


class DifferentialEvolutionProposer:
    """One generation a round, in the unit box (Storn & Price, J. Global Optim. 11 (1997) 341).

    SciPy offers no ask and tell. It is therefore run again from the start at every round with the same seed, is given
    the errors it has already asked for, and is stopped at its next question. This costs milliseconds, needs no thread,
    and makes the answer a function of the history.
    """

    def __init__(self, options: DifferentialEvolutionOptions, context: RunContext) -> None:
        self._options = options
        self._seed = context.seed

    @hookimpl
    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`."""
        space = context.task.space
        known = errors_by_round(context, self._error(context.trials))
        population = self._next_population(space.to_unit(space.initial), known)
        if population is None:
            return Proposal((), rationale=f"{_GENERATIONS} generations are over.", action="none", finished=True)
        return Proposal(
            tuple(space.from_unit(position) for position in population),
            rationale=f"Generation {len(known) + 1}.",
            action="sample",
            by_simulations=True,
        )

    def _error(self, trials: Sequence[Trial]) -> Callable[[Trial], float]:
        """What is minimised."""
        return lambda trial: trial.objective

    def _next_population(self, origin: FloatArray, known: list[FloatArray]) -> FloatArray | None:
        answers = iter(known)

        def simulate(population: FloatArray) -> FloatArray:
            answer = next(answers, None)
            if answer is None:
                raise _Question(population.T.copy())
            return answer

        try:
            differential_evolution(
                simulate,
                [(0.0, 1.0)] * len(origin),
                strategy=self._options.strategy,
                popsize=self._options.population,
                mutation=self._options.mutation,
                recombination=self._options.recombination,
                x0=np.clip(origin, 0.0, 1.0),
                rng=np.random.default_rng(self._seed),
                maxiter=_GENERATIONS,
                # A population that is alike, all of it failed for instance, is no reason to end before the budget does.
                tol=0.0,
                atol=-1.0,
                polish=False,
                updating="deferred",
                vectorized=True,
            )
        except _Question as question:
            return question.population
        return None


class WeightedDifferentialEvolutionProposer(DifferentialEvolutionProposer):
    """Minimises a weighted sum of the three errors, each relative to where it started (paper, Sec. 4.4)."""

    def __init__(self, options: WeightedDifferentialEvolutionOptions, context: RunContext) -> None:
        require_paper(context.task, "weighted-de")
        super().__init__(options, context)
        self._weights = {"q_mape": options.q_weight, "i_mape": options.i_weight, "v_mape": options.v_weight}

    def _error(self, trials: Sequence[Trial]) -> Callable[[Trial], float]:
        first = next((trial.metrics for trial in trials if trial.ok and trial.metrics is not None), None)
        scales = {name: max(float(getattr(first, name, 0.0)), 1e-6) for name in self._weights}

        def weighted(trial: Trial) -> float:
            if trial.metrics is None:
                return float("inf")
            return sum(
                # As a percentage of the first value, so that the penalty of a failure stays comparable.
                100.0 * weight * float(getattr(trial.metrics, name)) / scales[name]
                for name, weight in self._weights.items()
            )

        return weighted
