"""Random perturbations around the starting point."""

import numpy as np
from pydantic import BaseModel, Field

from ...core.hooks import ProposeContext, RunContext, hookimpl
from ...core.proposal import Proposal


class RandomWarmUpOptions(BaseModel, extra="forbid"):
    """How far the perturbations go."""

    spread: float = Field(0.08, gt=0, le=0.5, description="Standard deviation, as a share of each parameter's range.")


class RandomWarmUp:
    """Normally distributed perturbations of all parameters at once (the paper's Algorithm 1)."""

    def __init__(self, options: RandomWarmUpOptions, context: RunContext) -> None:
        self._spread = options.spread

    @hookimpl
    def warm_up(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.warm_up`."""
        space = context.task.space
        rng = np.random.default_rng(context.seed)
        origin = space.to_unit(space.initial)
        steps = self._spread * rng.standard_normal((context.simulations_left, len(space)))
        candidates = tuple(space.from_unit(np.clip(origin + step, 0.0, 1.0)) for step in steps)
        return Proposal(
            candidates, rationale="Random perturbations to learn what each parameter does.", action="warm-up"
        )
