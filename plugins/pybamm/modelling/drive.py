"""Protocols and measured currents, as PyBaMM experiments or as one function of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import casadi
import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import make_lsq_spline

from ....core.errors import BsaError
from ....core.taper import at_distinct_times, between_samples, from_its_beginning
from ....core.task import Protocol
from ....core.trajectory import SECONDS_PER_HOUR, FloatArray, StepKind, Trajectory, with_offset
from ..cells.parameter_sets import CUT_OFFS, pybamm

_WITHIN = 2e-3
"""Distance of a measured current from the straight lines that stand for it, as a share of its largest value: what
cyclers are accurate to. The charge is kept."""

EMPTY_V, FULL_V = 0.5, 6.0
"""Voltages at which a simulated cell is empty or overfull until a measured current changes, in place of the set's
cut-offs."""

WIDE_CUT_OFFS = dict(zip(CUT_OFFS, (EMPTY_V, FULL_V), strict=True))
"""They let a measured current run its course: a voltage event would end it before the record does."""

_BEYOND_V = 0.5
"""How far beyond its cut-offs and the measured voltages a simulated voltage is shown, at most: enough for it to be
the largest error of its record."""

DELAY = "Record begins later by [s]"
"""Input that says which of several records drives a cell that is compiled for all of them."""

JUMP_S = 1e-3
"""A step of the current takes this long in a function of time: short against any sampling, long against rounding."""


@dataclass(frozen=True, eq=False)
class Piece:
    """The current between two of its steps."""

    begin: float  # When it begins, s on the record's clock.
    # time, current: Knots in s since ``begin`` and A, positive on discharge; linear in between. Two knots of one height
    # are a constant current. Shape (k,).
    time: FloatArray
    current: FloatArray
    kind: str  # What the cycler was doing.

    @property
    def duration(self) -> float:
        """How long it lasts, s."""
        return float(self.time[-1])

    @property
    def constant(self) -> bool:
        """Whether it is one constant current."""
        return len(self.time) == 2 and self.current[0] == self.current[1]


@dataclass(frozen=True, eq=False)
class CurrentFunction:
    """A measured current as one piecewise linear function of time."""

    # time, current: Knots in s on the record's clock and A, positive on discharge. Reaches an hour beyond the record on
    # both sides, so that nothing is ever extrapolated. Shape (k,).
    time: FloatArray
    current: FloatArray
    # Where the integrator must stop and start again: both ends of every step. Without them its long steps in a rest
    # would miss the pulse after it. Shape (m,).
    stops: FloatArray
    finest_s: float | None  # Typical interval between knots where the current varies all the time (drive cycles), s.
    varying: FloatArray = field(default_factory=lambda: np.empty(0))  # The knots there, s. Shape (j,).
    several: bool = False  # Whether it holds several records; see `one_after_another`.


def steps_of_protocol(protocol: Protocol) -> list[list[Any]]:
    """A protocol as cycles of PyBaMM steps.

    Raises `BsaError` if a protocol string is not one that PyBaMM understands.
    """
    return [[_parse(text) for text in cycle] for cycle in protocol]


def _parse(text: str) -> Any:
    try:
        return pybamm.step.string(text)
    except (ValueError, TypeError, KeyError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BsaError(
            f'PyBaMM cannot read the step "{text}": {reason}',
            'write for example "Discharge at 1C until 2.5 V" or "Rest for 1 hour".',
        ) from None


def shown_range(window_v: tuple[float, float], measured_v: FloatArray) -> tuple[float, float]:
    """Between which voltages a simulation under a measured current is shown, V.

    The voltage of an empty cell falls by volts within seconds, and how many these are means nothing: no instrument lets
    a cell go far beyond its cut-offs.
    """
    lowest, highest = window_v
    return min(lowest, float(np.min(measured_v))) - _BEYOND_V, max(highest, float(np.max(measured_v))) + _BEYOND_V


class _Table(pybamm.Interpolant):  # type: ignore[misc]
    """A piecewise linear function whose knots are stored once.

    PyBaMM's own hands the whole table on at each evaluation: of a drive cycle with 45,000 knots that takes half of a
    simulation's time.
    """

    def create_copy(self, new_children: Any = None, perform_simplifications: bool = True) -> _Table:
        """See `pybamm.Symbol.new_copy`."""
        children = self._children_for_copying(new_children)
        return _Table(self.x, self.y, children, self.name, self.interpolator, entries_string=self.entries_string)

    def _linear_to_casadi(self, converted_children: Any) -> Any:
        return casadi.interpolant("current", "linear", [self.x[0]], self.y)(converted_children[0])


def interpolant(current: CurrentFunction) -> Any:
    """A measured current as a PyBaMM expression of time, and of the input `DELAY` where it has several records."""
    time = pybamm.t + pybamm.InputParameter(DELAY) if current.several else pybamm.t
    return _Table(current.time, current.current, time, interpolator="linear")


def one_after_another(drives: Sequence[CurrentFunction]) -> tuple[CurrentFunction, list[float]]:
    """The currents of several records as one function of time, and how much later each record is in it, s."""
    if len(drives) == 1:
        return drives[0], [0.0]
    delays, end = [], 0.0
    for one in drives:
        delays.append(end + 1.0 - float(one.time[0]))
        end = float(one.time[-1]) + delays[-1]
    time = np.concatenate([one.time + delay for one, delay in zip(drives, delays, strict=True)])
    current = np.concatenate([one.current for one in drives])
    # Knots a rounding error apart become one when they are shifted.
    apart = np.append(np.diff(time) > 0, True)
    return CurrentFunction(time[apart], current[apart], np.empty(0), None, several=True), delays


def gate(begin: str, end: str) -> Any:
    """1, and 0 between the two times that these inputs give."""

    def rise(time: str) -> Any:
        return pybamm.minimum(pybamm.maximum((pybamm.t - pybamm.InputParameter(time)) / JUMP_S, 0), 1)

    return 1 - rise(begin) + rise(end)


def current_function(record: Trajectory) -> CurrentFunction:
    """The measured current of a record, as a function of time that one compiled model can be driven by."""
    pieces = [piece for piece in pieces_of(record) if piece.duration > 3 * JUMP_S]
    times: list[FloatArray] = []
    currents: list[FloatArray] = []
    stops: list[float] = []
    varying: list[float] = []
    for piece in pieces:
        # The jump lies behind the last sample of the step before, which still shows that step's current.
        start, end = piece.begin + JUMP_S, piece.begin + piece.duration
        inside = (piece.time > JUMP_S) & (piece.time < piece.duration)
        times.append(np.concatenate([[start], piece.begin + piece.time[inside], [end]]))
        currents.append(np.interp(times[-1] - piece.begin, piece.time, piece.current))
        stops += [start, end]
        varying += times[-1].tolist() if piece.kind is StepKind.DRIVE else []
    drives = [float(np.median(np.diff(piece.time))) for piece in pieces if piece.kind is StepKind.DRIVE]
    time, current = np.concatenate(times), np.concatenate(currents)
    # A cycler that logs one sample at rest before it begins shows the voltage at rest there.
    first, before = float(record.time[0]), float(record.current[0])
    time = np.concatenate([[first - 3600.0, first], time, [time[-1] + 3600.0]])
    current = np.concatenate([[before, before], current, [current[-1]]])
    apart = np.append(np.diff(time) > 0, True)
    return CurrentFunction(
        time[apart], current[apart], np.unique([first, *stops]), min(drives) if drives else None, np.array(varying)
    )


Current = TypeVar("Current", Piece, CurrentFunction)


def offset_by(drive: Current, offset: float) -> Current:
    """The same with an offset wherever a current passes, A."""
    return replace(drive, current=with_offset(drive.current, offset))


def drawn_ah(current: CurrentFunction, times: FloatArray) -> FloatArray:
    """Charge that a current has drawn at some times since the first of them, A.h, shape (n,)."""
    knots = np.union1d(current.time, times)
    charge = cumulative_trapezoid(np.interp(knots, current.time, current.current), knots, initial=0.0)
    drawn = np.interp(times, knots, charge)
    return np.asarray(drawn - drawn[0]) / SECONDS_PER_HOUR


def pieces_of(record: Trajectory) -> list[Piece]:
    """The current of a record that is cut into steps, piece by piece.

    Each begins where the one before it logged its last sample (`from_its_beginning`): cyclers log one when a step ends.
    """
    result: list[Piece] = []
    begin = float(record.time[0])
    for step in record.steps:
        time, current = from_its_beginning(record, step)
        if time[-1] > begin:
            result.append(Piece(begin, *_knots(time - begin, current, step.kind), step.kind))
        begin = float(time[-1])
    return result


def _knots(time: FloatArray, current: FloatArray, kind: str) -> tuple[FloatArray, FloatArray]:
    """The fewest knots that say what the samples say."""
    mean = float(np.trapezoid(current, time) / time[-1])
    if kind is StepKind.REST and abs(mean) < 1e-6:
        mean = 0.0
    steady = np.ptp(current) <= max(_WITHIN * abs(mean), 1e-6) or len(time) < 3
    if kind is StepKind.REST or steady or (kind is not StepKind.DRIVE and _only_noise(current)):
        return time[[0, -1]], np.array([mean, mean])
    time, current = at_distinct_times(time, current)
    return _straight_knots(*(between_samples(time, current) if kind is StepKind.CV_HOLD else (time, current)))


def _only_noise(current: FloatArray) -> bool:
    """Whether neighbours differ as much as samples far apart do: a constant current read by a noisy meter."""
    middle = current[1:-1]
    if len(middle) < 8:
        return False
    return float(np.std(np.diff(middle))) > 1.1 * float(np.std(middle))


def _straight_knots(time: FloatArray, current: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A varying current by few knots, with the charge kept: between knots its samples lie on straight lines.

    Every knot is a kink that costs the integrator a few steps, or a restart; a cycler that logs ten times for each
    change of the current shows few of them. The values at the knots are fitted to the samples.
    """
    within = _WITHIN * float(np.max(np.abs(current)))
    kept = np.zeros(len(time), dtype=bool)
    kept[[0, -1]] = True
    pieces = [(0, len(time) - 1)]
    while pieces:
        first, last = pieces.pop()
        line = np.interp(time[first : last + 1], time[[first, last]], current[[first, last]])
        off = np.abs(current[first : last + 1] - line)
        farthest = first + int(np.argmax(off))
        if off[farthest - first] > within:
            kept[farthest] = True
            pieces += [(first, farthest), (farthest, last)]
    knots = time[kept]
    # Each sample counts for the time that it stands for: the charge that is left over is then none.
    weights = np.sqrt(np.gradient(time))
    fitted = make_lsq_spline(time, current, np.concatenate([knots[:1], knots, knots[-1:]]), k=1, w=weights)
    return knots, np.asarray(fitted(knots))
