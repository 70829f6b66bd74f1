"""Reads a prompt as a language model would see it: headings and fenced JSON blocks, nothing else.

Any plugin may write any section, so whatever does not have a section's form is left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ...core.feedback import Feedback
from ...core.messages import Message
from ...core.numbers import finite_number, finite_numbers
from ...core.prompt_sections import (
    FEEDBACK,
    LAST_ATTEMPT,
    NUMERICS,
    PRIORS,
    SENSITIVITIES,
    TASK,
    TRIALS,
    read_sections,
)
from ...core.sensitivities import Sensitivities
from .coordinates import to_steps
from .numerics import Numerics, entries, words

_MOST_STEPS = 1e9
"""Typical steps beyond which a value cannot be counted in them without loss."""

_LARGEST_FACTOR = 1e3
"""A typical step that multiplies by more is none."""


@dataclass(frozen=True)
class PastTrial:
    """An earlier trial: its values in the order of the searched parameters, and its features or residuals."""

    values: tuple[float, ...]
    numbers: Mapping[str, float]


@dataclass(frozen=True)
class DomainRule:
    """Which quantities a parameter raises and lowers."""

    parameter: str
    raises: tuple[str, ...]
    lowers: tuple[str, ...]


@dataclass(frozen=True)
class Prompt:
    """What the prompt says, by section.

    Attributes
    ----------
    parameters : dict of str to float
        The searched parameters and their present values.
    steps : dict of str to str
        A change of each parameter that is worth trying, ``"*1.1"`` or ``"+0.03"``.
    features : dict of str to float
        The numbers that are to become zero: features, or residuals where there are no others.
    overshot : bool
        Whether the latest attempt was no better.
    sensitivities : Sensitivities
        What each parameter does to each feature; empty without memory.
    trials : tuple of PastTrial
        Empty without memory.
    rules : tuple of DomainRule
        Empty without priors.
    good_enough : dict of str to float
        Mismatches that are as good as none, by the end of a feature's name.
    bounds : dict of str to (lower, upper)
        Empty without priors.
    numerics : Numerics
        What the numerical fit beside the agent is doing.
    """

    parameters: dict[str, float]
    steps: dict[str, str]
    features: dict[str, float]
    overshot: bool = False
    sensitivities: Sensitivities = field(default_factory=lambda: Sensitivities({}))
    trials: tuple[PastTrial, ...] = ()
    rules: tuple[DomainRule, ...] = ()
    good_enough: dict[str, float] = field(default_factory=dict)
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)
    numerics: Numerics = field(default_factory=Numerics)


def read_prompt(messages: Sequence[Message]) -> Prompt:
    """The sections of the first user message; later turns hold only complaints about replies."""
    text = next((message.text for message in messages if message.role == "user"), "")
    sections = read_sections(text)
    # Memories stand between the task and the feedback: one with the heading of either must not stand in for it.
    task = next((_mapping(content) for heading, content in sections if heading == TASK), {})
    parameters, steps = _parameters(task)
    last = {heading: _mapping(content) for heading, content in sections}
    priors = last.get(PRIORS, {})
    return Prompt(
        parameters=parameters,
        steps=steps,
        features=Feedback(last.get(FEEDBACK, {})).numbers,
        overshot=LAST_ATTEMPT in last,
        sensitivities=Sensitivities.read(last.get(SENSITIVITIES)),
        trials=_trials(last.get(TRIALS, {})),
        rules=_rules(priors.get("rules")),
        good_enough={name: size for name, size in finite_numbers(task.get("good_enough")).items() if size > 0},
        bounds=_bounds(priors.get("bounds"), steps),
        numerics=Numerics.read(last.get(NUMERICS)),
    )


def _parameters(task: Mapping[str, Any]) -> tuple[dict[str, float], dict[str, str]]:
    values: dict[str, float] = {}
    steps: dict[str, str] = {}
    for name, entry in _mapping(task.get("parameters")).items():
        value, step = finite_number(_mapping(entry).get("now")), str(_mapping(entry).get("typical_step"))
        if value is not None and _is_step(step) and abs(to_steps(value, step)) < _MOST_STEPS:
            values[name], steps[name] = value, step
    return values, steps


def _is_step(text: str) -> bool:
    try:
        size = float(text.removeprefix("*"))
    except ValueError:
        return False
    return 1.0 < size <= _LARGEST_FACTOR if text.startswith("*") else 0.0 < size < math.inf


def _trials(history: Mapping[str, Any]) -> tuple[PastTrial, ...]:
    names = words(history.get("features"))
    return tuple(_trial(row, names) for row in entries(history.get("trials")) if isinstance(row, Mapping))


def _trial(row: Mapping[str, Any], names: Sequence[str]) -> PastTrial:
    values = [finite_number(value) for value in entries(row.get("values"))]
    features = entries(row.get("features"))
    numbers = finite_numbers(dict(zip(names, features, strict=True))) if len(features) == len(names) else {}
    return PastTrial(tuple(value for value in values if value is not None), numbers or finite_numbers(row))


def _rules(content: object) -> tuple[DomainRule, ...]:
    return tuple(
        DomainRule(rule["parameter"], words(rule.get("raises")), words(rule.get("lowers")))
        for rule in entries(content)
        if isinstance(rule, Mapping) and isinstance(rule.get("parameter"), str)
    )


def _bounds(content: object, steps: Mapping[str, str]) -> dict[str, tuple[float, float]]:
    """Lower and upper bound of the searched parameters, where both can be counted in typical steps."""
    found: dict[str, tuple[float, float]] = {}
    for name, pair in _mapping(content).items():
        numbers = [number for value in entries(pair) if (number := finite_number(value)) is not None]
        if name in steps and len(numbers) == 2 and all(abs(to_steps(v, steps[name])) < _MOST_STEPS for v in numbers):
            found[name] = (min(numbers), max(numbers))
    return found


def _mapping(content: object) -> Mapping[str, Any]:
    return content if isinstance(content, Mapping) else {}
