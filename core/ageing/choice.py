"""Which of many cycles matter: where the fade bends, and where a simulation is furthest off."""

from collections.abc import Sequence

import numpy as np

from .cycle_table import CycleTable

KEPT = 8
"""Cycles of a long record whose curves are kept: enough for any fade that a person would draw by hand."""

SHOWN = 6
"""Cycles that are shown in detail in one round."""

_LEAST_BEND = 0.02
"""Height of the bend over the chord, as a share of the fade, below which a fade is straight and has no knee."""

_LESSER = 0.5
"""Height of a bend as a share of that of the bend the other way, below which it may be a recovery after a pause."""


def knee(table: CycleTable) -> int | None:
    """The cycle at which the fade turns steeper: furthest above the chord from first to last. None where none does."""
    return _furthest(table, above=True)


def levelling(table: CycleTable) -> int | None:
    """The cycle at which the fade turns flatter: furthest below the chord from first to last. None where none does."""
    return _furthest(table, above=False)


def _furthest(table: CycleTable, above: bool) -> int | None:
    # The first cycle starts from another state than all others: what sets it apart is no bend.
    cycles = table.cycle[1:]
    if len(cycles) < 5:
        return None
    capacity = _smooth(table.capacity_ah[1:])
    fade = float(np.ptp(capacity))
    if fade <= 0:
        return None
    chord = np.interp(cycles, cycles[[0, -1]], capacity[[0, -1]])
    height = (capacity - chord) * (1.0 if above else -1.0)
    place = int(np.argmax(height))
    least = max(_LEAST_BEND * fade, _LESSER * float(np.max(np.abs(height))))
    return int(cycles[place]) if height[place] > least else None


def _smooth(values: np.ndarray) -> np.ndarray:
    """A running median over a tenth of a life, so that odd cycles, and recoveries after pauses, make no bend."""
    width = min(max(5, len(values) // 10), len(values))
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1))


def kept_cycles(count: int, table: CycleTable | None = None) -> tuple[int, ...]:
    """The cycles of a record whose curves are kept.

    Of ``count`` cycles those of the table alone are chosen, where there is one: the first, the last, its bends, and
    others that lie denser in early life, where cells change fastest.
    """
    wanted = [1, count]
    if table is not None:
        wanted += [cycle for cycle in (knee(table), levelling(table)) if cycle is not None]
    # Between even spacing, which would miss the first cycles, and logarithmic, which would miss the last ones.
    spread = 1.0 + (count - 1.0) * np.linspace(0.0, 1.0, max(KEPT - len(set(wanted)) + 2, 2)) ** 2
    wanted += [round(float(cycle)) for cycle in spread]
    if table is not None:
        wanted = [int(table.cycle[np.argmin(np.abs(table.cycle - cycle))]) for cycle in wanted]
    return tuple(sorted(set(wanted)))


def shown_cycles(
    kept: Sequence[int], measured: CycleTable, simulated: CycleTable | None, asked: Sequence[int] = ()
) -> dict[int, str]:
    """The cycles to look at in one round, each with the reason for it: the same number for any length of record.

    For cycles that were asked for stand the nearest kept ones. In the order of the cycles.
    """
    wanted: list[tuple[float | None, str]] = [(kept[0], "first"), (kept[-1], "last")]
    wanted += [(cycle, f"asked for ({cycle})") for cycle in asked[:SHOWN]]
    wanted += [(knee(measured), "knee of the fade"), (levelling(measured), "fade levels off")]
    if simulated is not None:
        off = np.abs(simulated.at(np.asarray(kept, dtype=np.float64)) - measured.at(np.asarray(kept, dtype=np.float64)))
        if np.any(np.isfinite(off)):
            wanted.append((kept[int(np.nanargmax(off))], "largest capacity mismatch"))
    wanted.append((kept[len(kept) // 2], "middle"))
    chosen: dict[int, str] = {}
    for cycle, reason in wanted:
        if cycle is None:
            continue
        nearest = min(kept, key=lambda known: abs(known - cycle))
        if nearest in chosen:
            chosen[nearest] += f", {reason}"
        elif len(chosen) < SHOWN:
            chosen[nearest] = reason
    return dict(sorted(chosen.items()))
