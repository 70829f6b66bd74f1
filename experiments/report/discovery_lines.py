"""What a discovery found, in lines for a terminal."""

from ...core.discovery.discovery import Discovery
from ...core.discovery.explanation import Estimate
from .wording import number, quantity


def found_lines(found: Discovery) -> list[str]:
    """The values of what was found, with their 95 % intervals, and the errors of the base model and with that.

    What was not named has no values here: `discovery.json` and the page have those of a partial explanation.
    """
    best = found.findings.best
    values = [_valued(effect.key, one) for effect in best.effects for one in best.estimates[effect.key]]
    errors = [_error(name, error["initial"], error["best"]) for name, error in found.errors.items()]
    untried = untried_line(found)
    return [*([untried] if untried else ()), *(values if found.named else ()), *(line for line in errors if line)]


def untried_line(found: Discovery) -> str:
    """That what was asked for was not evaluated, where noise explains what the base model leaves; else empty."""
    tried = found.findings.nominations or found.findings.explanations
    if tried or not found.restricted or found.verdict != "no-missing-effect":
        return ""
    return f"The {found.noun}s that were asked for were not evaluated: none was needed."


def _valued(effect: str, estimate: Estimate) -> str:
    value, (low, high), unit = estimate.physical
    bound = ", at a bound" * estimate.at_bound
    name = estimate.name.replace("_", " ")
    return f"{effect}: {name} {quantity(value, unit)} (95 % interval {number(low)} to {quantity(high, unit)}{bound})"


def _error(name: str, before: float | None, after: float | None) -> str:
    """An error of the base model and with what was found; once where both are the same, empty where there is none."""
    if before is None and after is None:
        return ""
    words, _, unit = name.removesuffix("]").partition(" [")
    values = number(after) if before == after else f"{number(before)} → {number(after)}"
    return f"{words}: {values} {unit}".strip()
