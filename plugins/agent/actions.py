"""What the agent may ask for: one flat object, checked against the task and the trials so far."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

from ...core.ageing.choice import SHOWN
from ...core.errors import BsaError, unknown
from ...core.messages import ALTERNATIVES, JsonSchema
from ...core.numbers import finite_number
from ...core.parameters import Candidate, ParameterSpace
from ...core.printable import strip_control
from ...core.trial import Trial
from .updates import apply_updates, unknown_parameter, updates_schema

Kind = Literal["set", "simulate", "jacobian", "predict", "look", "refine", "restart", "reduce"]

FREE: tuple[Kind, ...] = ("predict", "look")
"""Actions that are answered at once and cost no simulation."""

MOST_AT_ONCE = 3
"""Sets of changes that are simulated at once, at most."""

_MOST_SIMULATIONS, _DEFAULT_SIMULATIONS = 40, 5
"""Simulations that an action may ask for at most, and those of one that does not say how many."""

_LOWEST_RATE_PERCENT = 10
"""Lowest share of the currents from which "reduce" comes back, %."""

_ANALYSIS, _HYPOTHESIS, _RATIONALE = 4000, 300, 500
"""Characters of these texts, at most."""

_NEEDS: dict[Kind, tuple[str, ...]] = {
    "set": ("updated_params",),
    "simulate": ("candidates",),
    "look": ("step",),
    "restart": ("trial",),
}
"""Fields without which an action cannot be taken."""

_MAY_HAVE: dict[Kind, tuple[str, ...]] = {
    "predict": ("updated_params",),
    "jacobian": ("params", "simulations"),
    "refine": ("params", "simulations"),
    "restart": ("simulations",),
    "reduce": ("simulations", "reduce_rate_percent", "reduce_cycles"),
}

_REDUCED_BY: JsonSchema = {
    "reduce_rate_percent": {"type": "integer", "minimum": _LOWEST_RATE_PERCENT, "maximum": 100},
    "reduce_cycles": {"type": "integer", "minimum": 1},
}


@dataclass(frozen=True)
class Offer:
    """What the agent may ask for in a round."""

    kinds: tuple[Kind, ...]  # The actions.
    space: ParameterSpace  # What is searched.
    steps: tuple[str, ...] = ()  # Names of the steps that can be looked at.
    reasoning: bool = True  # Whether it is asked to think and to give reasons before it acts.
    drives: bool = False  # Whether the task can be made easier by what drives it (`Domain.drives`).
    cycles: int = 0  # Of a long record, how many cycles can be asked for.


@dataclass(frozen=True)
class Action:
    """A checked wish of the agent."""

    kind: Kind  # What to do, of `Kind`.
    # For ``set``, ``predict`` and ``simulate``: the values to try, inside the bounds.
    candidates: tuple[Candidate, ...] = ()
    updates: Mapping[str, str] | None = None  # For ``set`` and ``predict``: the changes as written.
    projected: tuple[str, ...] = ()  # Parameters whose value was moved to a bound.
    parameters: tuple[str, ...] = ()  # For ``refine`` and ``jacobian``: what may move; empty for all.
    simulations: int = _DEFAULT_SIMULATIONS  # How many simulations the action may take.
    step: str = ""  # For ``look``: which step.
    trial: int | None = None  # For ``restart``: where from.
    # For ``reduce``: the share of the currents to come back from; None for a gentler cell at full rate.
    rate: float | None = None
    cycles: int | None = None  # For ``reduce``: how many of the record's cycles to fit first; None for all.
    look_at: tuple[int, ...] = ()  # Cycles of a long record that the next feedback is to show in detail.
    # analysis, hypothesis, rationale: The agent's words.
    analysis: str = ""
    hypothesis: str = ""
    rationale: str = ""

    @property
    def carries_on(self) -> bool:
        """Whether it only lets the numerical fit proceed."""
        return self.kind == "refine" and not self.parameters


def action_schema(offer: Offer) -> JsonSchema:
    """JSON Schema of a reply: an action, what it needs, and the reasons, which come first; every string bounded.

    Where there is a choice each action has a schema of its own under `ALTERNATIVES`, so that a model that is held to
    it cannot ask for a change and leave the change out.
    """
    schema = _schema(offer, offer.kinds)
    if len(offer.kinds) == 1:
        return schema
    return {**schema, ALTERNATIVES: [_schema(offer, (kind,)) for kind in offer.kinds]}


def _schema(offer: Offer, kinds: tuple[Kind, ...]) -> dict[str, Any]:
    """A reply with one of these actions, and with what all of them need."""
    needed = [name for name in _NEEDS.get(kinds[0], ()) if len(kinds) == 1]
    taken = {name for kind in kinds for name in (*_NEEDS.get(kind, ()), *_MAY_HAVE.get(kind, ()))}
    parts = {name: part for name, part in _parts(offer).items() if name in taken}
    parts = {"action": {"type": "string", "enum": list(kinds)}, **parts}
    if "updated_params" in parts and not needed:
        parts["updated_params"] = {key: v for key, v in parts["updated_params"].items() if key != "minProperties"}
    if offer.cycles:
        cycle = {"type": "integer", "minimum": 1, "maximum": offer.cycles}
        parts["look_at"] = {"type": "array", "items": cycle, "maxItems": SHOWN}
    required = ["action", *needed]
    if offer.reasoning:
        before = {"analysis": _ANALYSIS, "hypothesis": _HYPOTHESIS}
        parts = {**_texts(before), **parts, **_texts({"rationale": _RATIONALE})}
        required = [*before, *required, "rationale"]
    return {"type": "object", "properties": parts, "required": required, "additionalProperties": False}


def _parts(offer: Offer) -> dict[str, dict[str, Any]]:
    """Schemas of what actions take, by field."""
    updates = updates_schema(offer.space)
    names = {"type": "string", "enum": list(offer.space.names)}
    return {
        "updated_params": updates,
        "candidates": {"type": "array", "items": updates, "minItems": 1, "maxItems": MOST_AT_ONCE},
        "params": {"type": "array", "items": names, "maxItems": len(offer.space)},
        "step": {"type": "string", "enum": list(offer.steps)},
        "simulations": {"type": "integer", "minimum": 1, "maximum": _MOST_SIMULATIONS},
        "trial": {"type": "integer", "minimum": 0},
        **(_REDUCED_BY if offer.drives else {}),
    }


def _texts(limits: Mapping[str, int]) -> dict[str, dict[str, Any]]:
    return {name: {"type": "string", "maxLength": limit} for name, limit in limits.items()}


def check_action(reply: Mapping[str, Any], offer: Offer, base: Candidate, trials: Sequence[Trial]) -> Action:
    """Check a parsed reply.

    A reply with changes and without an action asks for ``set``.

    Raises `BsaError` if the action is unknown or lacks what it needs; the message is made to be sent back to the model.
    """
    kind = reply.get("action", "set")
    if kind not in offer.kinds:
        shown = strip_control(str(kind))[:40]
        raise unknown(f'"action" is "{shown}".', str(kind), offer.kinds, f"choose one of {list(offer.kinds)}.")
    limits = {"analysis": _ANALYSIS * offer.reasoning, "hypothesis": _HYPOTHESIS, "rationale": _RATIONALE}
    words = {name: strip_control(str(reply.get(name, "")))[:limit] for name, limit in limits.items()}
    candidates: list[Candidate] = []
    updates: Mapping[str, str] | None = None
    projected: tuple[str, ...] = ()
    asked = reply.get("updated_params")
    if kind == "set" or (kind == "predict" and asked):
        candidate, updates, projected = apply_updates(asked, offer.space, base)
        candidates.append(candidate)
    elif kind == "simulate":
        rows = reply.get("candidates")
        if not isinstance(rows, list) or not rows:
            raise BsaError('"simulate" needs the list "candidates".', 'write [{"<name>": "*1.2"}, {"<name>": "*0.9"}].')
        for row in rows[:MOST_AT_ONCE]:
            candidate, _, moved = apply_updates(row, offer.space, base)
            candidates.append(candidate)
            projected += moved
    return Action(
        kind=cast(Kind, kind),
        candidates=tuple(candidates),
        updates=updates,
        projected=tuple(dict.fromkeys(projected)),
        parameters=_parameters(reply.get("params"), offer.space) if kind in ("refine", "jacobian") else (),
        simulations=_simulations(reply.get("simulations")),
        step=_step(reply.get("step"), offer) if kind == "look" else "",
        trial=_trial(reply.get("trial"), trials) if kind == "restart" else None,
        rate=_rate(reply.get("reduce_rate_percent")) if kind == "reduce" else None,
        cycles=_cycles(reply.get("reduce_cycles")) if kind == "reduce" else None,
        look_at=_look_at(reply.get("look_at"), offer),
        **words,
    )


def _parameters(asked: Any, space: ParameterSpace) -> tuple[str, ...]:
    names = [asked] if isinstance(asked, str) else list(asked or ()) if isinstance(asked, (list, tuple)) else []
    for name in names:
        if name not in space:
            raise unknown_parameter(name, space)
    chosen = tuple(name for name in space.names if name in names)
    return () if len(chosen) == len(space) else chosen


def _step(asked: Any, offer: Offer) -> str:
    if asked not in offer.steps:
        shown = strip_control(str(asked))[:40]
        raise unknown(f'"step" is "{shown}".', str(asked), offer.steps, f"choose one of {list(offer.steps)}.")
    return str(asked)


def _look_at(asked: Any, offer: Offer) -> tuple[int, ...]:
    """The cycles that exist; a wish that is none is no reason to lose the reply."""
    wanted = map(finite_number, asked if isinstance(asked, list) else [])
    return tuple(int(cycle) for cycle in wanted if cycle is not None and 1 <= cycle <= offer.cycles)[:SHOWN]


def _simulations(asked: Any) -> int:
    number = finite_number(asked)
    return _DEFAULT_SIMULATIONS if number is None else int(min(max(number, 1), _MOST_SIMULATIONS))


def _rate(asked: Any) -> float | None:
    """A share of the currents below 1; None for the full rate or what is no number."""
    number = finite_number(asked)
    if number is None:
        return None
    rate = min(max(number, _LOWEST_RATE_PERCENT), 100.0) / 100.0
    return rate if rate < 1.0 else None


def _cycles(asked: Any) -> int | None:
    number = finite_number(asked)
    return None if number is None else max(int(number), 1)


def _trial(asked: Any, trials: Sequence[Trial]) -> int:
    usable = [trial.index for trial in trials if trial.residuals is not None]
    if isinstance(asked, bool) or not isinstance(asked, int) or asked not in usable:
        raise BsaError(
            f'"restart" needs the number of a trial that ran to its end, not {str(asked)[:20]}.',
            f"for example {usable[:8]}." if usable else "none did yet: choose another action.",
        )
    return asked
