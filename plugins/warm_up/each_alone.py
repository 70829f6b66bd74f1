"""Each parameter alone: what a model need not be asked for."""

from ...core.hooks import NoOptions, ProposeContext, RunContext, hookimpl
from ...core.proposal import Proposal


class EachAloneWarmUp:
    """Moves one parameter at a time by its typical step, so that every effect is seen by itself."""

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        pass

    @hookimpl
    def warm_up(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.warm_up`; with fewer simulations than parameters the last ones are left out."""
        start = context.best.candidate
        candidates = [{**start, one.name: one.a_step_aside(start[one.name])} for one in context.task.space]
        return Proposal(
            tuple(candidates[: context.simulations_left]),
            rationale="Each parameter alone, by a step.",
            action="warm-up",
        )
