"""What a proposer wants tried next, and the grammar of a single change."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .errors import BsaError
from .parameters import Candidate
from .task_reduction import TaskReduction

# Bounded, since weak models that are held to it go on with digits: a third one of an exponent leads beyond any number.
_NUMBER = r"[0-9]{1,20}(\.[0-9]{0,20})?([eE][+-]?[0-9]{1,2})?"
CHANGE_PATTERN = rf"^[*+-]?{_NUMBER}$"
"""JSON Schema pattern of a change (anchored: JSON Schema patterns search otherwise)."""

FIT = "fit"
"""Among the ``authors`` in a proposal's details: a numerical fit beside the model asked for the candidate."""

PROBLEMS, NO_REPLY = "problems", "no reply"
"""In a proposal's details: what was wrong with the language model's answers, in order; how one begins that is none."""

CHANGED_FROM = "changed_from"
"""In a proposal's details: the number of the simulation whose values the candidates change, where one was named to the
language model."""

ALREADY_SIMULATED = "already_simulated"
"""In a proposal's details: how many candidates were left out since the run has simulated them."""

LACKING = "lacking"
"""In the details of a proposal that ends a search: what is left out for lack of simulations, in a sentence."""


def apply_change(value: float, change: str | float) -> float:
    """Apply one change in the paper's notation to a value.

    ``"*1.2"`` multiplies, ``"+0.02"`` and ``"-0.02"`` add, and a bare number replaces. The result is
    not yet projected onto the bounds.

    Raises
    ------
    BsaError
        If the change is not a finite number in one of these forms.
    """
    if isinstance(change, bool) or not isinstance(change, (str, int, float)):
        raise BsaError(f"the change {change!r} is not a number.", 'write "*1.2", "+0.02" or an absolute value.')
    text = change.strip() if isinstance(change, str) else ""
    try:
        if text.startswith("*"):
            result = value * float(text[1:])
        elif text.startswith(("+", "-")):
            result = value + float(text)
        else:
            result = float(change)
    except (ValueError, OverflowError):
        shown = repr(change if len(str(change)) <= 40 else str(change)[:40] + "...")
        raise BsaError(f"the change {shown} is not a number.", 'write "*1.2", "+0.02" or an absolute value.') from None
    if not math.isfinite(result):
        raise BsaError(f"the change {change!r} gives {result}.", "every value must be finite.")
    return result


def is_change(text: str) -> bool:
    """Whether the text is a change in the notation of `apply_change`."""
    return re.fullmatch(CHANGE_PATTERN, text) is not None


def unusable_replies(details: Mapping[str, Any]) -> int:
    """How many replies of the language model could not be used, by the details of the proposal that they led to."""
    problems = details.get(PROBLEMS)
    return sum(not str(problem).startswith(NO_REPLY) for problem in problems) if isinstance(problems, list) else 0


@dataclass(frozen=True)
class Proposal:
    """One or more candidates, with the reasons for them.

    Attributes
    ----------
    candidates : tuple of Candidate
        Complete candidates inside the bounds; each costs one simulation. Empty for a lost round.
    hypothesis, rationale : str
        Why: the physical cause supposed, and what the change should do.
    action : str
        What kind of move this is (``"set"``, ``"refine"``, ``"jacobian"``, ...), for the report.
    updates : mapping of str to str
        The changes as the model wrote them.
    details : mapping
        Anything else worth keeping in the journal (step size, rank, the model's analysis).
    lost : str
        Why the round was lost, if it was.
    finished : bool
        The proposer has nothing better to offer: the run may stop after these candidates.
    advancing : bool
        The proposer knows by its own measure whether it still improves, and says when it is finished: the
        run's patience does not count this round.
    by_simulations : bool
        The method's budget is the number of simulations alone, as a sampler's is: neither the run's rounds nor its
        patience count this round, unless it has no candidates.
    reductions : tuple of TaskReduction or None
        How the task is reduced for each candidate; empty where it is not.
    """

    candidates: tuple[Candidate, ...]
    hypothesis: str = ""
    rationale: str = ""
    action: str = "set"
    updates: Mapping[str, str] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)
    lost: str = ""
    finished: bool = False
    advancing: bool = False
    by_simulations: bool = False
    reductions: tuple[TaskReduction | None, ...] = ()
