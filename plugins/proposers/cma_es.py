"""CMA-ES, asked and told through pycma."""

from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from ...core.hooks import ProposeContext, RunContext, hookimpl
from ...core.parameters import ParameterSpace
from ...core.proposal import Proposal
from .trial_errors import errors_by_round


class CmaEsOptions(BaseModel, extra="forbid"):
    """Settings of pycma."""

    sigma: float = Field(0.2, gt=0, le=1, description="First standard deviation, as a share of each range.")
    population: int | None = Field(
        None, ge=2, description="Candidates a generation; the paper's number of parameters + 1 if left out."
    )


class CmaEsProposer:
    """One generation a round, in the unit box (Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772).

    A strategy is rebuilt from the history at every round: with the same random numbers and the same errors it stands
    where the last round left it, so a resumed run asks for the same candidates.
    """

    def __init__(self, options: CmaEsOptions, context: RunContext) -> None:
        self._options = options
        self._seed = context.seed

    @hookimpl
    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`."""
        space = context.task.space
        strategy = self._strategy(space)
        generations = errors_by_round(context)
        for told in generations:
            strategy.tell(strategy.ask()[: len(told)], told.tolist())
        candidates = tuple(space.from_unit(position[: len(space)]) for position in strategy.ask())
        return Proposal(
            candidates,
            rationale=f"Generation {len(generations) + 1}, step size {strategy.sigma:.3g}.",
            action="sample",
            by_simulations=True,
        )

    def _strategy(self, space: ParameterSpace) -> Any:
        import cma

        rng = np.random.default_rng(self._seed)
        settings = {
            "popsize": self._options.population or len(space) + 1,
            "bounds": [0.0, 1.0],
            # Its own random numbers: pycma would otherwise seed and use numpy's global ones.
            "randn": lambda *shape: rng.standard_normal(shape),
            "seed": np.nan,
            "verbose": -9,
            "verb_log": 0,
        }
        origin = np.clip(space.to_unit(space.initial), 0.0, 1.0)
        if len(origin) == 1:
            # pycma refuses one dimension; a second one that does nothing is its author's own advice.
            origin = np.append(origin, 0.5)
        return cma.CMAEvolutionStrategy(origin, self._options.sigma, settings)
