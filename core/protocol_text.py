"""Protocols as people write them: ``200 x [Charge at 1C until 4.2 V, Discharge at 1C until 2.5 V]`` is 200 cycles."""

import re
from collections.abc import Iterator, Sequence
from itertools import groupby

from .errors import BsaError

Cycle = tuple[str, ...]

MOST_CYCLES = 100_000
"""More cycles than any cell lives; a larger count is a typing error."""

_WRITTEN_OUT = 2
"""So many equal cycles are written out, as they always were."""

_REPEATED = re.compile(r"^\s*(?P<count>\d{1,9})\s*x\s*\[(?P<steps>.*)\]\s*$", re.DOTALL)


def runs_of(protocol: Sequence[Cycle]) -> Iterator[tuple[int, Cycle]]:
    """Equal cycles that follow each other: how many, and the cycle."""
    for cycle, group in groupby(protocol):
        yield sum(1 for _ in group), cycle


def written(protocol: Sequence[Cycle]) -> list[list[str] | str]:
    """A protocol in few lines: a list of steps for each cycle, and one text for more than two equal ones."""
    lines: list[list[str] | str] = []
    for count, cycle in runs_of(protocol):
        if count > _WRITTEN_OUT and not any("," in step for step in cycle):
            lines.append(f"{count} x [{', '.join(cycle)}]")
        else:
            lines += [list(cycle)] * count
    return lines


def read_protocol(lines: Sequence[Sequence[str] | str]) -> tuple[Cycle, ...]:
    """The inverse of `written`. Raises `BsaError` if a text is not of the form ``200 x [step, step]``."""
    cycles: list[Cycle] = []
    for line in lines:
        if not isinstance(line, str):
            cycles.append(tuple(line))
            continue
        found = _REPEATED.match(line)
        steps = tuple(step.strip() for step in found["steps"].split(",")) if found else ()
        if found is None or not all(steps) or not 1 <= int(found["count"]) <= MOST_CYCLES - len(cycles):
            raise BsaError(
                f'"{line[:80]}" is not a repeated cycle.',
                'write "200 x [Charge at 1C until 4.2 V, Discharge at 1C until 2.5 V]", or a list of steps.',
            )
        cycles += [steps] * int(found["count"])
    return tuple(cycles)
