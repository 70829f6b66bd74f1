"""What the agent may ask for: one flat object, checked against the task and the trials so far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast, get_args

from ....core.errors import BsaError, did_you_mean
from ....core.messages import JsonSchema
from ....core.parameters import Candidate, ParameterSpace
from ....core.reply_parsing import strip_control
from ....core.trial import Trial
from ...agent.reply_schema import apply_updates, reply_schema

Kind = Literal["set", "refine", "jacobian", "restart", "reduce"]

KINDS: tuple[Kind, ...] = get_args(Kind)

_MOST_SIMULATIONS = 40
_DEFAULT_SIMULATIONS = 5
_LOWEST_RATE_PERCENT = 10

_EASED_BY: JsonSchema = {
    "reduce_rate_percent": {"type": "integer", "minimum": _LOWEST_RATE_PERCENT, "maximum": 100},
    "reduce_cycles": {"type": "integer", "minimum": 1},
}


@dataclass(frozen=True)
class Action:
    """A checked wish of the agent.

    Attributes
    ----------
    kind : {'set', 'refine', 'jacobian', 'restart', 'reduce'}
        What to do.
    candidate : Candidate or None
        For ``set``: the values to try.
    updates : mapping of str to str
        For ``set``: the changes as written.
    parameters : tuple of str
        For ``refine``: what may move; empty for all.
    simulations : int
        How many simulations the action may take.
    trial : int or None
        For ``restart``: where from.
    rate : float or None
        For ``reduce``: the share of the currents to come back from; None for a gentler cell at full rate.
    cycles : int or None
        For ``reduce``: how many of the record's cycles to fit first; None for all.
    analysis, hypothesis, rationale : str
        The agent's words.
    """

    kind: Kind
    candidate: Candidate | None = None
    updates: Mapping[str, str] | None = None
    parameters: tuple[str, ...] = ()
    simulations: int = _DEFAULT_SIMULATIONS
    trial: int | None = None
    rate: float | None = None
    cycles: int | None = None
    analysis: str = ""
    hypothesis: str = ""
    rationale: str = ""

    @property
    def carries_on(self) -> bool:
        """Whether it only lets the numerical fit proceed."""
        return self.kind == "refine" and not self.parameters


def action_schema(space: ParameterSpace, drives: bool = True) -> JsonSchema:
    """JSON Schema of a reply: the agent's own (`reply_schema`) with an action and what it needs, still flat.

    Parameters
    ----------
    space : ParameterSpace
        What is searched.
    drives : bool
        Whether the task can be reduced by what drives it (`Domain.drives`).
    """
    agent = reply_schema(space)
    properties = dict(agent["properties"])
    updates = {key: value for key, value in properties["updated_params"].items() if key != "minProperties"}
    return {
        **agent,
        "properties": {
            "analysis": properties["analysis"],
            "hypothesis": properties["hypothesis"],
            "action": {"type": "string", "enum": list(KINDS)},
            "updated_params": updates,
            "refine_params": {
                "type": "array",
                "items": {"type": "string", "enum": list(space.names)},
                "maxItems": len(space),
            },
            "simulations": {"type": "integer", "minimum": 1, "maximum": _MOST_SIMULATIONS},
            "trial": {"type": "integer", "minimum": 0},
            **(_EASED_BY if drives else {}),
            "rationale": properties["rationale"],
        },
        "required": ["analysis", "hypothesis", "action", "rationale"],
    }


def check_action(reply: Mapping[str, Any], space: ParameterSpace, base: Candidate, trials: Sequence[Trial]) -> Action:
    """Check a parsed reply.

    Raises
    ------
    BsaError
        If the action is unknown or lacks what it needs; the message is made to be sent back to the model.
    """
    kind = reply.get("action")
    if kind not in KINDS:
        shown = strip_control(str(kind))[:40]
        raise BsaError(f'"action" is "{shown}".', did_you_mean(str(kind), KINDS) or f"choose one of {list(KINDS)}.")
    limits = {"analysis": 800, "hypothesis": 300, "rationale": 500}
    words = {name: strip_control(str(reply.get(name, "")))[:limit] for name, limit in limits.items()}
    candidate, updates, trial = None, None, None
    if kind == "set":
        asked = reply.get("updated_params")
        if not isinstance(asked, Mapping):
            raise BsaError('"set" needs the object "updated_params".', 'write {"<name>": "*1.2"}.')
        candidate, updates, _ = apply_updates(asked, space, base)
    if kind == "restart":
        trial = _trial(reply.get("trial"), trials)
    return Action(
        kind=cast(Kind, kind),
        candidate=candidate,
        updates=updates,
        parameters=_parameters(reply.get("refine_params"), space) if kind == "refine" else (),
        simulations=_simulations(reply.get("simulations")),
        trial=trial,
        rate=_rate(reply.get("reduce_rate_percent")) if kind == "reduce" else None,
        cycles=_cycles(reply.get("reduce_cycles")) if kind == "reduce" else None,
        **words,
    )


def _parameters(asked: Any, space: ParameterSpace) -> tuple[str, ...]:
    names = [asked] if isinstance(asked, str) else list(asked or ()) if isinstance(asked, (list, tuple)) else []
    for name in names:
        if name not in space:
            raise BsaError(
                f'"{strip_control(str(name))[:80]}" in "refine_params" is not a searched parameter.',
                did_you_mean(str(name), space.names) or f"the searched parameters are {list(space.names)}.",
            )
    chosen = tuple(name for name in space.names if name in names)
    return () if len(chosen) == len(space) else chosen


def _simulations(asked: Any) -> int:
    if isinstance(asked, bool) or not isinstance(asked, (int, float)) or asked != asked:
        return _DEFAULT_SIMULATIONS
    return int(min(max(asked, 1), _MOST_SIMULATIONS))


def _rate(asked: Any) -> float | None:
    """A share of the currents below 1; None for the full rate or what is no number."""
    if not _is_number(asked):
        return None
    rate = min(max(float(asked), _LOWEST_RATE_PERCENT), 100.0) / 100.0
    return rate if rate < 1.0 else None


def _cycles(asked: Any) -> int | None:
    return max(int(asked), 1) if _is_number(asked) else None


def _is_number(asked: Any) -> bool:
    return isinstance(asked, (int, float)) and not isinstance(asked, bool) and -1e9 < asked < 1e9


def _trial(asked: Any, trials: Sequence[Trial]) -> int:
    usable = [trial.index for trial in trials if trial.residuals is not None]
    if isinstance(asked, bool) or not isinstance(asked, int) or asked not in usable:
        raise BsaError(
            f'"restart" needs the number of a trial that ran to its end, not {str(asked)[:20]}.',
            f"for example {usable[:8]}." if usable else "none did yet: choose another action.",
        )
    return asked
