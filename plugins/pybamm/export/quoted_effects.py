"""Effects as source text, for scripts that need pybamm alone."""

import inspect
import textwrap
from collections.abc import Callable
from functools import partial
from typing import Any

from ....core.effect import Effect
from ....core.parameters import Candidate
from ..augmentation import part_of


def quoted(number: int, effect: Effect, candidate: Candidate) -> dict[str, Any]:
    """An effect as source text: its functions are quoted as they stand, under names of their own."""
    part = part_of(effect)
    measurement = effect.measurement
    functions: dict[str, Callable[..., Any] | None] = {
        "values": part.values,
        "voltage": part.voltage,
        "current": part.current,
    }
    if measurement is not None:
        functions |= {"clock": measurement.clock, "meter": measurement.voltage}
    given = {kind: function for kind, function in functions.items() if function is not None}
    return {
        "title": effect.title,
        "equation": effect.equation,
        "citation": effect.citation,
        "p": effect.values(candidate),
        "borrowed": dict(part.borrowed),
        "points": dict(part.points),
        "source": "\n\n\n".join(_source(function, f"{kind}_{number}") for kind, function in given.items()),
        "calls": {kind: f"{kind}_{number}" for kind in given},
    }


def _source(function: Callable[..., Any], name: str) -> str:
    if isinstance(function, partial):
        given = "".join(f"{value!a}, " for value in function.args)
        named = "".join(f", {key}={value!a}" for key, value in function.keywords.items())
        call = f"def {name}(*arguments):\n    return {name}_for({given}*arguments{named})"
        return f"{_source(function.func, f'{name}_for')}\n\n\n{call}"
    text = textwrap.dedent(inspect.getsource(function))
    return text.replace(f"def {function.__name__}(", f"def {name}(", 1).rstrip()
