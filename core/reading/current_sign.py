"""Asks the voltage which way the current flows, and turns it positive on discharge."""

from dataclasses import replace

import numpy as np

from ..errors import BsaError
from ..record import ReadOptions
from ..segmentation.levels import answer
from .samples import Samples
from .stretches import Places, directions, steady_stretches, stretches

BOTH_WAYS_V = 0.5
"""Under a current of one sign the voltage moves one way. After a larger load it recovers against a small one, by up to
some tenths of a volt; a move of more than this, in V, is a charge or a discharge."""

_TELLING_V = 0.02
"""A voltage that moves by less, in V, shows noise and relaxation: it tells nothing of the current's sign."""


def with_sign(samples: Samples, options: ReadOptions) -> Samples:
    """Turn the current positive on discharge, after asking the voltage whether the stated sign can be true.

    Raises `BsaError` if the voltage contradicts the stated sign, or cannot tell where ``auto`` asks it.
    """
    _refuse_still_current(samples)
    evidence, start, stop = _discharge_positive(samples)
    stated: str = options.current_sign
    found = "discharge-positive" if evidence > 0 else "charge-positive"
    if stated == "auto":
        if abs(evidence) < 0.3:
            raise BsaError(
                f"{samples.source}: the voltage does not tell the sign of column {samples.column('current')}.",
                "say --current-sign charge-positive or --current-sign discharge-positive.",
            )
        stated = found
        samples = samples.noted(f"the current was found to be {stated} in the file.")
    elif abs(evidence) > 0.3 and stated != found:
        way = "falls" if samples.voltage[stop] < samples.voltage[start] else "rises"
        said = options.constant_current_a if "current" not in samples.names else None
        what = f"column {samples.column('current')}" if said is None else "the current of --constant-current"
        raise BsaError(
            f"{samples.source}: {what} is {samples.current[(start + stop) // 2]:.4g} A while the voltage {way} from "
            f"{samples.voltage[start]:.4g} V ({samples.place(start)}) to {samples.voltage[stop]:.4g} V "
            f"({samples.place(stop)}), so it is not {stated}.",
            f"say --current-sign {found}." if said is None else _turned(said, stated),
        )
    return samples if stated == "discharge-positive" else replace(samples, current=-samples.current)


def _turned(constant_a: float, stated: str) -> str:
    sign = "negative" if stated == "charge-positive" else "positive"
    return f"give --constant-current={-constant_a:g}: a discharge is {sign} there."


def _refuse_still_current(samples: Samples) -> None:
    swing = float(np.ptp(np.quantile(samples.voltage, [0.02, 0.98])))
    if not np.any(samples.current) and swing > 0.5:
        raise BsaError(
            f"{samples.source}: column {samples.column('current')} is 0 A throughout while the voltage moves by "
            f"{swing:.2g} V.",
            "say which column is the current with --column current=NAME, or --constant-current.",
        )


def _discharge_positive(samples: Samples) -> tuple[float, int, int]:
    """Evidence from -1 (positive on charge) to 1 (positive on discharge), and the stretch that shows it best."""
    current, voltage = samples.current, samples.voltage
    if not np.any(current):
        return 0.0, 0, len(samples) - 1
    signs = directions(current)
    first, last = stretches(samples)
    moves = voltage[last] - voltage[first]
    total = float(np.sum(np.abs(moves)))
    best = int(np.argmax(np.abs(moves)))
    trend = float(-np.sum(signs[first] * moves)) / total if total > _TELLING_V else 0.0
    if np.all(signs >= 0) or np.all(signs <= 0):
        if total > BOTH_WAYS_V and abs(trend) < 0.5:
            raise _sizes_only(samples, first, last)
        _refuse_both_ways(samples)
    jump = answer(np.diff(current), np.diff(voltage)) if np.ptp(voltage) > _TELLING_V else 0.0
    # Trend and switches tell the same; where they contradict each other, neither counts.
    evidence = trend if abs(trend) >= 0.3 else jump
    if trend * jump < 0 and abs(jump) > 0.5:
        evidence = 0.0
    return evidence, int(first[best]), int(last[best])


def _refuse_both_ways(samples: Samples) -> None:
    """Refuse a current of one sign that both charges and discharges the cell by far.

    The voltage rises where a discharge becomes smaller: what counts is a stretch without a jump of the current.
    """
    first, last = steady_stretches(samples)
    moves = samples.voltage[last] - samples.voltage[first]
    if min(np.max(moves), -np.min(moves)) > BOTH_WAYS_V:
        raise _sizes_only(samples, first, last)


def _sizes_only(samples: Samples, first: Places, last: Places) -> BsaError:
    voltage = samples.voltage
    moves = voltage[last] - voltage[first]
    furthest = {"rises": moves.argmax(), "falls": moves.argmin()}
    ways = sorted((int(first[k]), int(last[k]), way) for way, k in furthest.items())
    said = " and ".join(
        f"{way} from {voltage[start]:.4g} V ({samples.place(start)}) to {voltage[stop]:.4g} V ({samples.place(stop)})"
        for start, stop, way in ways
    )
    return BsaError(
        f"{samples.source}: column {samples.column('current')} never changes its sign, yet the voltage {said} under "
        "current.",
        'the file gives sizes only: export the current with its sign, or a column "State" with the words charge and '
        "discharge.",
    )
