"""Parameter values counted in typical steps, so that a radius and a state of charge are moved alike."""

import math


def to_steps(value: float, step: str) -> float:
    """A value on the axis on which one typical step has length 1."""
    if step.startswith("*"):
        return math.log(value) / math.log(float(step[1:])) if value > 0 else -math.inf
    return value / float(step)


def change_by(steps: float, step: str, digits: int = 6) -> str:
    """So many typical steps, in the notation of a proposal."""
    if step.startswith("*"):
        return f"*{float(step[1:]) ** steps:.{digits}g}"
    return f"{steps * float(step):+.{digits}g}"
