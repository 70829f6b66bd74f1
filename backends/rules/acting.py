"""Chooses an action beside a numerical fit: none while the misfit falls, an intervention where it has stalled."""

from typing import Any

from .reading import Prompt
from .reasoner import failed_in_a_row, propose, unmeasured

_FALLS, _ROUNDS_BACK = 0.8, 4
"""A fit whose misfit fell below this share of what it was so many rounds ago is left alone."""

_PATIENCE = 8
"""Simulations for which a fit that is left alone goes on before the next action is chosen."""

_STUCK = 3
"""Changes in a row that were no better, after which effects are measured again where the budget allows it."""

_TRIP = 30
"""Simulations for a trip once the fit beside has ended."""


def act_alone(prompt: Prompt) -> dict[str, Any]:
    """A reply to the agent's prompt, where there is no fit beside: measure what is not known, then change."""
    missing = unmeasured(prompt)
    stuck = len(failed_in_a_row(prompt)) >= _STUCK and prompt.simulations_left > len(prompt.parameters) + _STUCK
    if missing or (stuck and prompt.sensitivities.effects):
        return {
            "analysis": f"The effects of {', '.join(missing) or 'all parameters'} are not known here.",
            "hypothesis": "",
            "action": "jacobian",
            "params": missing,
            "rationale": "Measure them before they are used.",
        }
    return {"action": "set", **propose(prompt)}


def act(prompt: Prompt) -> dict[str, Any]:
    """A reply to the hybrid's prompt."""
    status = prompt.numerics.status
    if status == "infeasible":
        return _reply(
            "Nothing could be simulated yet: the solver fails before the record ends.",
            "The values are harsher than the model can bear.",
            "reduce",
            "Gentler values first.",
            simulations=prompt.numerics.allowance,
        )
    if status == "done":
        return _after_the_end(prompt)
    if _misfit_falls(prompt) or prompt.numerics.actions[-1:] == ("set",):
        return _continue_fit(prompt)
    return {**propose(prompt), "action": "set", "simulations": 1}


def _misfit_falls(prompt: Prompt) -> bool:
    misfits = prompt.numerics.misfits
    return len(misfits) <= _ROUNDS_BACK or misfits[-1] < _FALLS * misfits[-1 - _ROUNDS_BACK]


def _continue_fit(prompt: Prompt) -> dict[str, Any]:
    misfit = next(reversed(prompt.numerics.misfits), None)
    reason = "The misfit still falls" if _misfit_falls(prompt) else "The last manual value did not lower the misfit"
    return _reply(
        f"{reason}; it is {misfit} tolerances.{_said_by_the_record(prompt)}",
        "The parameters are off together, and the slopes say by how much.",
        "refine",
        "Let the fit go on.",
        simulations=_PATIENCE,
    )


def _said_by_the_record(prompt: Prompt) -> str:
    """What is fixed, open and moves together, in a sentence; empty while no slopes are known."""
    record = prompt.numerics.record
    if record is None:
        return ""
    fixed = prompt.parameters.keys() - {*record.leaves_open, *record.narrows}
    text = f" The record fixes {len(fixed)} of {len(prompt.parameters)} parameters here"
    if record.leaves_open:
        text += f", leaves open {', '.join(record.leaves_open)}"
    groups = [" with ".join(group) for group in record.only_together]
    return text + (f", and moves {'; '.join(groups)} only together." if groups else ".")


def _after_the_end(prompt: Prompt) -> dict[str, Any]:
    """The fit ended far from the record: first a reduced task, then fresh slopes, then values by the features."""
    tried = prompt.numerics.actions
    if "reduce" not in tried:
        return _reply(
            "The fit has ended far from the record: a local minimum, as where a step has vanished.",
            "A step that vanished hides what the parameters do.",
            "reduce",
            "Bring it back with gentler values, match the rest, then everything.",
            simulations=_TRIP,
        )
    if tried[-1] != "jacobian" and tried.count("jacobian") < 2:
        return _reply(
            "The fit has ended; its sensitivities may be out of date.",
            "The slopes have changed on the way.",
            "jacobian",
            "Measure them again and go on from the best point.",
            simulations=_TRIP,
        )
    if tried.count("set") < 2:
        return {**propose(prompt), "action": "set", "simulations": 1}
    return _reply(
        "Nothing tried since the fit ended was better.",
        "What is left is beyond these parameters.",
        "refine",
        "Leave it at that.",
        simulations=1,
    )


def _reply(analysis: str, hypothesis: str, action: str, rationale: str, simulations: int) -> dict[str, Any]:
    return {
        "analysis": analysis,
        "hypothesis": hypothesis,
        "action": action,
        "simulations": simulations,
        "rationale": rationale,
    }
