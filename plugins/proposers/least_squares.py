"""Least squares on the step-aligned residuals: the numerical baseline, and the hybrid's engine."""

from ...core.hooks import ProposeContext, RunContext, hookimpl
from ...core.proposal import Proposal
from .descent import Descent, DescentOptions

_WHY = {
    "jacobian": "Finite differences: what does each parameter do here?",
    "low-fidelity": "Where the low-fidelity model, corrected by the simulations so far, expects the least misfit.",
    "emulated": "Where an emulator, learnt from the simulations so far, expects the least misfit.",
}
"""By what a fit asks for next, where it descends."""


class LeastSquaresProposer:
    """Bounded least squares: steps by a low-fidelity model, an emulator or Jacobians; a Jacobian or a step a round.

    It rebuilds itself on resume by being asked the same questions and told the same trials.
    """

    def __init__(self, options: DescentOptions, context: RunContext) -> None:
        self._options = options
        self._seed = context.seed
        self._descent: Descent | None = None
        self._seen = 0

    @hookimpl
    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`."""
        if self._descent is None:
            self._descent = Descent(context.task, self._options, self._seed, context.best, context.low_fidelity)
        else:
            self._descent.tell(context.trials[self._seen :])
        self._seen = len(context.trials)
        return next_proposal(self._descent, context.simulations_left)


def next_proposal(descent: Descent, limit: int) -> Proposal:
    """What a fit asks for next, with its reasons; at most ``limit`` candidates."""
    candidates = descent.ask(limit)
    return Proposal(
        tuple(candidates),
        rationale=words(descent),
        action=action(descent),
        details=numbers(descent),
        finished=not candidates,
        by_simulations=True,
        reductions=descent.reductions[: len(candidates)],
    )


def action(descent: Descent) -> str:
    """What kind of move comes next."""
    if descent.status in ("infeasible", "restarting"):
        return "reduce" if descent.status == "infeasible" else "restart"
    return "jacobian" if descent.next_stage == "jacobian" else "refine"


def words(descent: Descent) -> str:
    """Why, in a sentence."""
    if descent.status == "infeasible":
        return descent.way_back
    if descent.status == "done":
        return descent.ending
    if descent.status == "restarting":
        return "The fit ended far from the record: it starts again from another point."
    return _WHY.get(descent.next_stage, "The damped least-squares step from the best point.")


def numbers(descent: Descent) -> dict[str, float]:
    """What the fit knows of itself, for the journal."""
    best = descent.best
    if best is None:
        return {}
    return {"misfit_tolerances": descent.misfit, "noise_tolerances": descent.noise, "damping": best.damping}
