"""No fit at all: the parameter set as published, the row every table begins with."""

from ...core.hooks import NoOptions, ProposeContext, RunContext, hookimpl
from ...core.proposal import Proposal


class DefaultProposer:
    """Proposes nothing; the initial trial stands."""

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        pass

    @hookimpl
    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`."""
        return Proposal((), rationale="The parameter set as it is.", action="none", finished=True)
