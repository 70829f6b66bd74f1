"""Reads a prompt as a language model would see it: headings and fenced JSON blocks, nothing else.

Any plugin may write any section, so whatever does not have a section's form is left out.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ...core.feedback import Feedback
from ...core.inference.typical_steps import to_steps
from ...core.messages import Message
from ...core.numbers import finite_number, finite_numbers
from ...core.prompt_sections import (
    DIGEST,
    FEEDBACK,
    LAST_ATTEMPT,
    NUMERICS,
    PRIORS,
    SENSITIVITIES,
    TASK,
    TRIAL_FEATURES,
    TRIALS,
    read_sections,
    read_table,
)
from ...core.sensitivities import Sensitivities
from .numerics import Numerics, entries, words

_MOST_STEPS = 1e9
"""Typical steps beyond which a value cannot be counted in them without loss."""

_LARGEST_FACTOR = 1e3
"""A typical step that multiplies by more is none."""


@dataclass(frozen=True)
class PastTrial:
    """An earlier trial."""

    index: int  # Its number.
    # Its values in typical steps above the present ones, in the order of the searched parameters.
    steps: tuple[float, ...]
    numbers: Mapping[str, float]  # Its features or residuals, where they are told.
    asked_by: str = ""  # Who asked for it.


@dataclass(frozen=True)
class DomainRule:
    """Which quantities a parameter raises and lowers."""

    parameter: str
    raises: tuple[str, ...]
    lowers: tuple[str, ...]


@dataclass(frozen=True)
class Prompt:
    """What the prompt says, by section."""

    parameters: dict[str, float]  # The searched parameters and their present values.
    steps: dict[str, str]  # A change of each parameter that is worth trying, ``"*1.1"`` or ``"+0.03"``.
    features: dict[str, float]  # The numbers that are to become zero: features, or residuals where there are no others.
    tolerances: dict[str, float] = field(default_factory=dict)  # The size of a mismatch that counts as one, by feature.
    # The latest attempt where it was no better, in typical steps from the present values; empty if there is none.
    attempt: tuple[float, ...] = ()
    # What each parameter does to each feature; empty without memory.
    sensitivities: Sensitivities = field(default_factory=lambda: Sensitivities({}))
    trials: tuple[PastTrial, ...] = ()  # Empty without memory.
    rules: tuple[DomainRule, ...] = ()  # Empty without priors.
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)  # Of the parameters, where they are told.
    numerics: Numerics = field(default_factory=Numerics)  # Where the fit stands that runs beside the agent.
    present: int = 0  # Number of the present trial.
    simulations_left: int = 0  # How many more there may be.
    suggested: Mapping[str, str] = field(default_factory=dict)  # The change that a digest suggests.


def read_prompt(messages: Sequence[Message]) -> Prompt:
    """The sections of the first user message; later turns hold answers to free questions and complaints."""
    text = next((message.text for message in messages if message.role == "user"), "")
    sections = read_sections(text)
    # Memories stand between the task and the feedback: one with the heading of either must not stand in for it.
    task = next((_mapping(content) for heading, content in sections if heading == TASK), {})
    parameters, steps, bounds = _parameters(task)
    order = tuple(str(row.get("parameter")) for row in _rows(task.get("parameters")))
    last = {heading: _mapping(content) for heading, content in sections}
    feedback = Feedback.read(last.get(FEEDBACK))
    attempt = finite_numbers(last.get(LAST_ATTEMPT, {}).get("changed_by_steps"))
    return Prompt(
        parameters=parameters,
        steps=steps,
        features=feedback.numbers,
        tolerances=feedback.tolerances,
        attempt=tuple(attempt.get(name, 0.0) for name in parameters) if attempt else (),
        sensitivities=Sensitivities.read(last.get(SENSITIVITIES), tuple(feedback.numbers), order),
        trials=_trials(last.get(TRIALS, {}), len(parameters), tuple(feedback.numbers)),
        rules=_rules(last.get(PRIORS, {}).get("rules")),
        bounds=bounds,
        numerics=Numerics.read(last.get(NUMERICS), order),
        present=int(finite_number(feedback.content.get("trial")) or 0),
        simulations_left=int(finite_number(feedback.content.get("simulations_left")) or 0),
        suggested={
            str(name): change
            for name, change in _mapping(last.get(DIGEST, {}).get("suggested_change")).items()
            if isinstance(change, str)
        },
    )


def _rows(content: object) -> list[dict[str, Any]]:
    """The rows of a table by column."""
    columns, rows = read_table(content)
    return [dict(zip(columns, row, strict=True)) for row in rows]


def _parameters(task: Mapping[str, Any]) -> tuple[dict[str, float], dict[str, str], dict[str, tuple[float, float]]]:
    """Present values, typical steps, and bounds where both can be counted in typical steps."""
    values: dict[str, float] = {}
    steps: dict[str, str] = {}
    bounds: dict[str, tuple[float, float]] = {}
    for row in _rows(task.get("parameters")):
        name, value, step = row.get("parameter"), finite_number(row.get("now")), str(row.get("step"))
        if not isinstance(name, str) or value is None or not _is_step(step) or not _countable(value, step):
            continue
        values[name], steps[name] = value, step
        ends = [number for key in ("lower", "upper") if (number := finite_number(row.get(key))) is not None]
        if len(ends) == 2 and all(_countable(end, step) for end in ends):
            bounds[name] = (min(ends), max(ends))
    return values, steps, bounds


def _countable(value: float, step: str) -> bool:
    return abs(to_steps(value, step)) < _MOST_STEPS


def _is_step(text: str) -> bool:
    try:
        size = float(text.removeprefix("*"))
    except ValueError:
        return False
    return 1.0 < size <= _LARGEST_FACTOR if text.startswith("*") else 0.0 < size < math.inf


def _trials(history: Mapping[str, Any], count: int, features: tuple[str, ...]) -> tuple[PastTrial, ...]:
    told = _mapping(history.get(TRIAL_FEATURES))
    found = []
    for row in _rows(history.get("trials")):
        values = entries(told.get(f"trial_{row.get('trial')}"))
        numbers = dict(zip(features, values, strict=True)) if len(values) == len(features) else {}
        found.append(_trial(row, finite_numbers(numbers)))
    return tuple(trial for trial in found if len(trial.steps) == count)


def _trial(row: Mapping[str, Any], features: Mapping[str, float]) -> PastTrial:
    steps = [finite_number(value) for value in entries(row.get("steps_from_present"))]
    return PastTrial(
        int(finite_number(row.get("trial")) or 0),
        tuple(step for step in steps if step is not None and abs(step) < _MOST_STEPS),
        features or finite_numbers(row),
        str(row.get("asked_by", "")),
    )


def _rules(content: object) -> tuple[DomainRule, ...]:
    return tuple(
        DomainRule(entry[0], _listed(row.get("raises")), _listed(row.get("lowers")))
        for row in _rows(content)
        for entry in entries(row.get("parameters_and_why"))
        if isinstance(entry, list) and entry and isinstance(entry[0], str)
    )


def _listed(content: object) -> tuple[str, ...]:
    return tuple(content.split(", ")) if isinstance(content, str) else words(content)


def _mapping(content: object) -> Mapping[str, Any]:
    return content if isinstance(content, Mapping) else {}
