"""Random search: candidates drawn evenly from the search space."""

import numpy as np
from pydantic import BaseModel, Field

from ...core.hooks import ProposeContext, RunContext, hookimpl
from ...core.proposal import Proposal


class RandomOptions(BaseModel, extra="forbid"):
    """How many candidates a round draws."""

    batch: int = Field(10, ge=1, description="Candidates a round; they are simulated side by side.")


class RandomProposer:
    """Draws from the unit box, each axis on its parameter's own scale."""

    def __init__(self, options: RandomOptions, context: RunContext) -> None:
        self._batch = options.batch

    @hookimpl
    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`."""
        rng = np.random.default_rng(context.seed)
        count = min(self._batch, context.simulations_left)
        candidates = tuple(context.task.space.sample(rng) for _ in range(count))
        return Proposal(candidates, rationale="Drawn at random.", action="sample", by_simulations=True)
