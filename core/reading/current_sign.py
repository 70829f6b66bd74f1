"""Asks the voltage which way the current flows, and turns it positive on discharge."""

from dataclasses import replace

import numpy as np

from ..errors import BsaError
from ..record import ReadOptions
from .clock import gaps_in
from .samples import Samples


def with_sign(samples: Samples, options: ReadOptions) -> Samples:
    """Turn the current positive on discharge, after asking the voltage whether the stated sign can be true.

    Raises `BsaError` if the voltage contradicts the stated sign, or cannot tell where ``auto`` asks it.
    """
    _refuse_still_current(samples)
    evidence, start, stop = _discharge_positive(samples)
    stated = options.current_sign
    if stated == "auto":
        if abs(evidence) < 0.3:
            raise BsaError(
                f"{samples.source}: the voltage does not tell the sign of column {samples.column('current')}.",
                "say --current-sign charge-positive or --current-sign discharge-positive.",
            )
        stated = "discharge-positive" if evidence > 0 else "charge-positive"
        samples = samples.noted(f"the current was found to be {stated} in the file.")
    elif (evidence > 0.3 and stated == "charge-positive") or (evidence < -0.3 and stated == "discharge-positive"):
        other = "discharge-positive" if evidence > 0 else "charge-positive"
        way = "falls" if samples.voltage[stop] < samples.voltage[start] else "rises"
        raise BsaError(
            f"{samples.source}: column {samples.column('current')} is {samples.current[(start + stop) // 2]:.4g} A "
            f"while the voltage {way} from {samples.voltage[start]:.4g} V ({samples.place(start)}) to "
            f"{samples.voltage[stop]:.4g} V ({samples.place(stop)}), so it is not {stated}.",
            f"say --current-sign {other}.",
        )
    return samples if stated == "discharge-positive" else replace(samples, current=-samples.current)


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
    scale = float(np.max(np.abs(current)))
    if scale == 0.0:
        return 0.0, 0, len(samples) - 1
    signs = np.where(np.abs(current) > 0.02 * scale, np.sign(current), 0.0)
    # What happened in a gap is not known: a charge may stand between two discharges.
    cuts = np.union1d(np.flatnonzero(np.diff(signs)), gaps_in(samples.time)) + 1
    edges = np.concatenate([[0], cuts, [len(signs)]])
    first, last = edges[:-1], edges[1:] - 1
    flowing = signs[first] != 0
    first, last = first[flowing], last[flowing]
    moves = voltage[last] - voltage[first]
    total = float(np.sum(np.abs(moves)))
    best = int(np.argmax(np.abs(moves)))
    trend = float(-np.sum(signs[first] * moves)) / total if total > 0.02 else 0.0
    if total > 0.5 and abs(trend) < 0.5 and (np.all(signs >= 0) or np.all(signs <= 0)):
        raise BsaError(
            f"{samples.source}: column {samples.column('current')} never changes its sign, yet the voltage both rises "
            f"and falls under current (from {voltage[first[best]]:.4g} V in {samples.place(int(first[best]))} to "
            f"{voltage[last[best]]:.4g} V in {samples.place(int(last[best]))}).",
            "the file gives sizes only: export the current with its sign.",
        )
    steps, answers = np.diff(current), np.diff(voltage)
    size = float(np.sqrt(np.sum(steps**2) * np.sum(answers**2)))
    jump = -float(np.sum(steps * answers)) / size if size > 0 else 0.0
    # Trend and switches tell the same; where they contradict each other, neither counts.
    evidence = trend if abs(trend) >= 0.3 else jump
    if trend * jump < 0 and abs(jump) > 0.5:
        evidence = 0.0
    return evidence, int(first[best]), int(last[best])
