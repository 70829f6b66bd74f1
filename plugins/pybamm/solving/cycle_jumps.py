"""Leaves out cycles in which a cell changes steadily: the change over a cycle is followed instead of the cycle.

From one cycle to the next a cell's state at the end of the cycle changes by a little, and that change changes
slowly. Two cycles in a row show it; a few such pairs, integrated over the cycle number, stand for all cycles between
them. It is the heterogeneous multiscale method (E and Engquist, Comm. Math. Sci. 1 (2003) 87) with the cycle number
as its slow time: an Adams-Bashforth prediction over the cycles left out, and an Adams-Moulton correction by the pair
simulated after them, whose size is the error by which the next length is chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ....core.trajectory import FloatArray, Trajectory

TOLERANCE = 2e-5
"""Share of the first capacity by which a prediction may be off before it is corrected: 0.002 %.

What grows for long before the capacity shows it is followed less well: a loss that doubles every 70 cycles comes out
0.05 % late."""

_REJECTED = 3.0
"""A prediction this many tolerances off is made again over fewer cycles."""

_SETTLING = 2
"""Cycles after a change of protocol in which the state still settles, and shows no steady change."""

_FIRST_LEFT_OUT = 4
"""Cycles that the first jump leaves out at most, before the error of a prediction is known."""

_MOST_GROWTH, _SAFETY = 2.5, 0.9
"""Largest growth of the step length and safety factor, as in any step control; the prediction is of third order."""

_STRETCH = 1.25
"""A cycle that is needed, and is this little beyond the safe length, is reached at once; the error is then twice as
large."""

_APART = 0.4
"""Share of the coming cycles by which two changes should lie apart to tell how the change changes."""


class CycleFailed(Exception):
    """A cycle could not be simulated to its end."""


@dataclass(frozen=True, eq=False)
class SolvedCycle:
    """One simulated cycle."""

    number: int  # From 1.
    state: Any  # Where it ended; whatever the simulator starts the next one from.
    vector: FloatArray  # The state as numbers. Shape (m,).
    capacity_ah: float  # Charge drawn in its discharge; 0 without one.
    record: Trajectory  # Its curves, from its own start.
    # What was lost up to its end, as in a `CycleTable`; empty where the model cannot tell.
    losses: tuple[float, ...] = ()
    # Voltage where a resistance is read after its first discharge sets in, V; NaN for that at the switch.
    first_v: float = float("nan")


@dataclass(frozen=True, eq=False)
class Pace:
    """The change from one cycle's end to the next one's."""

    place: float  # Half way between the two cycle numbers.
    vector: FloatArray  # Change of the state. Shape (m,).
    capacity_ah: float  # Change of the capacity.

    @classmethod
    def between(cls, before: SolvedCycle, after: SolvedCycle) -> Pace:
        """The pace of two cycles in a row."""
        return cls(
            0.5 * (before.number + after.number), after.vector - before.vector, after.capacity_ah - before.capacity_ah
        )

    def line(self, earlier: Pace, place: float) -> Pace:
        """The pace elsewhere on the straight line through an earlier one and this one."""
        share = (place - self.place) / (self.place - earlier.place)
        return Pace(
            place,
            self.vector + share * (self.vector - earlier.vector),
            self.capacity_ah + share * (self.capacity_ah - earlier.capacity_ah),
        )


Simulate = Callable[[int, Any], SolvedCycle]
"""Simulates the cycle of a number from a state; raises `CycleFailed`."""

Restate = Callable[[Any, FloatArray], Any]
"""A state with other numbers."""


class CycleRunner:
    """Runs equal cycles one after the other, those that are not needed left out where that is safe.

    See `TOLERANCE`; with None every cycle is simulated.
    """

    def __init__(self, restate: Restate, state: Any, tolerance: float | None = TOLERANCE) -> None:
        self._restate, self._tolerance = restate, tolerance
        self.state = state

    def run(self, simulate: Simulate, first: int, last: int, needed: Collection[int]) -> Iterator[SolvedCycle]:
        """The simulated cycles among ``first`` to ``last``, those needed and the last one in any case.

        Raises `CycleFailed` if a cycle cannot be simulated from where the one before it ended.
        """
        self._paces: list[Pace] = []
        self._longest = _FIRST_LEFT_OUT
        solved: SolvedCycle | None = None
        number = first
        while number <= last:
            coming = min((cycle for cycle in needed if number <= cycle <= last), default=last)
            room = coming - number - 1
            left_out = room if room <= _STRETCH * self._longest else self._longest
            steady = len(self._paces) >= 2 and solved is not None and _give_charge(solved)
            if not steady or left_out < 1 or self._tolerance is None:
                before, solved = solved, simulate(number, self.state)
                self.state = solved.state
                if before is not None and number > first + _SETTLING - 1 and _give_charge(before, solved):
                    self._paces.append(Pace.between(before, solved))
                yield solved
                number += 1
                continue
            assert solved is not None
            pair = self._jump(simulate, solved, left_out, self._tolerance)
            if pair is not None:
                yield from pair
                solved = pair[1]
                number = solved.number + 1

    def _jump(
        self, simulate: Simulate, start: SolvedCycle, left_out: int, tolerance: float
    ) -> tuple[SolvedCycle, SolvedCycle] | None:
        """The two cycles behind those left out; None if fewer must be left out, which is noted."""
        latest = self._paces[-1]
        earlier = self._earlier(latest, _APART * left_out)
        places = start.number + np.arange(1, left_out + 1) - 0.5
        predicted = latest.line(earlier, float(np.mean(places)))
        moved = self._restate(start.state, start.vector + left_out * predicted.vector)
        try:
            one = simulate(start.number + left_out + 1, moved)
            two = simulate(one.number + 1, one.state)
            steady = _give_charge(one, two)
        except CycleFailed:
            steady = False
        if not steady:
            self._longest = left_out // 2
            return None
        found = Pace.between(one, two)
        expected = latest.line(earlier, found.place)
        weight = float(np.sum((places - earlier.place) * (places - latest.place))) / (
            (found.place - earlier.place) * (found.place - latest.place)
        )
        error = abs(weight * (found.capacity_ah - expected.capacity_ah)) / start.capacity_ah
        growth = _SAFETY * (tolerance / max(error, 1e-3 * tolerance)) ** (1.0 / 3.0)
        if error > _REJECTED * tolerance and left_out > 1:
            self._longest = max(1, int(left_out * max(growth, 0.2)))
            return None
        grown = max(1, int(left_out * min(growth, _MOST_GROWTH)))
        # Cycles that are needed may have kept it shorter than it could have been.
        self._longest = max(grown, self._longest) if left_out < self._longest and growth >= 1.0 else grown
        self._paces.append(found)
        corrected = two.vector + weight * (found.vector - expected.vector)
        two = replace(two, state=self._restate(two.state, corrected), vector=corrected)
        self.state = two.state
        return one, two

    def _earlier(self, latest: Pace, apart: float) -> Pace:
        """The latest pace that lies so far before the latest one; the first one if none does."""
        far = [pace for pace in self._paces[:-1] if latest.place - pace.place >= apart]
        return far[-1] if far else self._paces[0]


def _give_charge(*cycles: SolvedCycle) -> bool:
    """Whether each cycle has a discharge: without one nothing tells how a cell changes."""
    return all(cycle.capacity_ah > 0 for cycle in cycles)
