"""Which published open-circuit potentials describe a cell: those of installed sets, fitted to its slowest record."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from ....core.errors import BsaError, unknown
from ....core.reading.summary import SLOW_HOURS, SLOW_SWING_V
from ....core.target import CellChange, ocp_name
from ....core.task import NEAREST, ParameterFile, ParameterSource
from ....core.trajectory import SECONDS_PER_HOUR, FloatArray, StepKind, Trajectory
from ..cells.ocp_shape import ELECTRODES, GRID, OcpCurves
from ..cells.parameter_files import as_json
from ..cells.parameter_sets import load, pybamm, set_names
from ..cells.state_of_charge import initial_concentration, maximum_concentration

_FASTEST_HOURS = 0.7
"""Length of a charge or discharge from which it tells whose potentials a cell has where none is slow, h. Six records at
C/2 and 1C of five measured cells come out with a positive electrode of their own chemistry, at 2C one of two does
(docs/real-cells-results.md)."""

_POINTS = 200
"""Points of a step, at equal charges."""

_COVERED = 0.5
"""Share of a record's charge that its steps cross at least: less does not tell how the electrodes are balanced."""

_STARTS = ((0.9, 0.03, 0.27, 0.9), (0.85, 0.02, 0.2, 0.95), (0.75, 0.01, 0.4, 0.98))
"""Stoichiometries of a full and an empty cell from which a fit starts: negative, then positive electrode."""

_LOWEST, _HIGHEST = (0.4, 5e-4, 5e-4, 0.5, 0.0), (0.9995, 0.3, 0.6, 0.9995, np.inf)
"""Their bounds, and those of the polarisation, V: a cell uses most of both electrodes between its cut-offs."""

_EVALUATIONS = 100
"""Steps of such a fit at most: a pair that describes the cell needs twenty."""

_POLARISATION_V = 0.01
"""Half the distance of a charge from a discharge, to start with."""

_NO_LITHIUM = ("Chayambuka2022",)
"""Installed sets of sodium-ion cells: PyBaMM's sets do not say it."""

_MOST = 0.95
"""Largest volume fraction of active material."""


@dataclass(frozen=True, eq=False)
class SlowCurve:
    """What a record's slowest charges and discharges show of the open-circuit voltage; shapes are (n,)."""

    share: FloatArray  # Charge drawn since the fullest point, from 0 to 1 at the emptiest.
    voltage: FloatArray  # Halfway between charge and discharge where both were measured, V.
    charge_ah: float  # Charge between these points.
    polarised: int  # 1 or -1 where the voltage is that of discharges or of charges alone, 0 where it is that of both.
    # By how much the charge lies above the discharge at the same charge, median, V; NaN where one was not measured.
    gap_v: float
    hours: float  # Length of the shorter of these steps.

    @property
    def words(self) -> str:
        """``"the slow record"``, or which one takes its place."""
        if self.hours >= SLOW_HOURS:
            return "the slow record"
        return f"the record at about {1.0 / self.hours:.1g}C (none is slow; it tells the chemistry, the rest roughly)"


@dataclass(frozen=True)
class Potentials:
    """Open-circuit potentials of two published electrodes, balanced as a measured cell shows them."""

    # negative, positive: The sets that they are from.
    negative: str
    positive: str
    rms_v: float  # What they leave of the slowest record, V.
    # Of each electrode, at the fullest and at the emptiest point of that record.
    stoichiometry: Mapping[str, tuple[float, float]]

    @property
    def sets(self) -> Mapping[str, str]:
        """The set of each electrode."""
        return {"Negative": self.negative, "Positive": self.positive}

    def __str__(self) -> str:
        if self.negative == self.positive:
            return self.negative
        return f"{self.negative} (negative) and {self.positive} (positive)"


def slow_curve(records: Iterable[Trajectory], hours: float = SLOW_HOURS) -> SlowCurve | None:
    """The curve of the record whose steps of so many hours or more cross most charge; None if none crosses enough."""
    found = [curve for record in records if (curve := _slow_curve(record, hours)) is not None]
    return max(found, key=lambda curve: curve.charge_ah, default=None)


def slowest_curve(records: Sequence[Trajectory]) -> SlowCurve | None:
    """The slow curve of the records; where there is none, that of a faster charge or discharge, up to about 1C."""
    return slow_curve(records) or slow_curve(records, _FASTEST_HOURS)


def _slow_curve(record: Trajectory, least_hours: float) -> SlowCurve | None:
    drawn = record.discharge_capacity
    measured: dict[StepKind, tuple[FloatArray, FloatArray, float]] = {}
    for step in record.steps:
        place = slice(step.start, step.stop)
        hours = float(record.time[step.stop - 1] - record.time[step.start]) / SECONDS_PER_HOUR
        slow = hours >= least_hours and np.ptp(record.voltage[place]) >= SLOW_SWING_V
        if slow and step.kind in (StepKind.CC_CHARGE, StepKind.CC_DISCHARGE):
            kind = StepKind(step.kind)
            longest = measured.get(kind)
            if longest is None or np.ptp(longest[0]) < np.ptp(drawn[place]):
                order = np.argsort(drawn[place], kind="stable")
                measured[kind] = drawn[place][order], record.voltage[place][order], hours
    if not measured:
        return None
    if not _overlap([charge for charge, _, _ in measured.values()]):
        widest = max(measured, key=lambda kind: float(np.ptp(measured[kind][0])))
        measured = {widest: measured[widest]}
    first, last = (float(end([end(charge) for charge, _, _ in measured.values()])) for end in (np.min, np.max))
    if last - first < _COVERED * np.ptp(drawn):
        return None
    at = np.linspace(first, last, _POINTS)
    curves = [np.interp(at, charge, voltage, left=np.nan, right=np.nan) for charge, voltage, _ in measured.values()]
    polarised = 0 if len(curves) > 1 else 1 if StepKind.CC_DISCHARGE in measured else -1
    voltage = _halfway(at, *curves) if len(curves) > 1 else curves[0]
    gap_v = float(np.nanmedian(np.abs(curves[1] - curves[0]))) if len(curves) > 1 else np.nan
    hours = min(hours for *_, hours in measured.values())
    return SlowCurve((at - first) / (last - first), voltage, last - first, polarised, gap_v, hours)


def _overlap(charges: Sequence[FloatArray]) -> bool:
    """Whether rising charges have more than a step between points in common; one alone overlaps with itself."""
    starts, ends = [charge[0] for charge in charges], [charge[-1] for charge in charges]
    return bool(min(ends) - max(starts) > (max(ends) - min(starts)) / (_POINTS - 1))


def _halfway(at: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
    """The mean of two curves; where only one is known, that one moved by half of the distance where both last were."""
    both = np.isfinite(one) & np.isfinite(other)
    half = 0.5 * np.interp(at, at[both], (other - one)[both])
    return np.where(np.isfinite(one), one + half, other - half)


def chosen_potentials(wanted: str, slow: SlowCurve | None, otherwise: str = "leave --ocp out") -> list[Potentials]:
    """Published potentials, those that describe the slowest record (`slowest_curve`) best first.

    ``wanted`` is ``"nearest"`` for the potentials of all installed sets, or the set, or two with a slash between them:
    ``"Mohtat2020/NCA_Kim2011"`` for the negative and the positive electrode. Raises `BsaError` if there is no such set,
    or no such curve: ``otherwise`` is then what to do without one.
    """
    if slow is None:
        raise BsaError(
            "no record holds a charge or discharge at 1C or less that crosses half of its charge.",
            f"open-circuit potentials are chosen by such a record, best at C/10 or less: add one, or {otherwise}.",
        )
    known = {which: published_potentials(which) for which in ELECTRODES}
    if wanted == NEAREST:
        chosen = [distinct(known[which]) for which in ELECTRODES]
    else:
        names = wanted.split("/")
        for which, name in zip(ELECTRODES, (names[0], names[-1]), strict=True):
            if name not in known[which]:
                message = f'"{name}" is no set with an open-circuit potential of the {which.lower()} electrode.'
                raise unknown(message, name, known[which], 'choose "nearest", or of {}.')
        chosen = [[names[0]], [names[-1]]]
    found = []
    for negative, positive in product(*chosen):
        curves = {"Negative": known["Negative"][negative], "Positive": known["Positive"][positive]}
        found.append(Potentials(negative, positive, *_balanced(slow, curves)))
    return sorted(found, key=lambda potentials: potentials.rms_v)


@cache
def published_potentials(which: str) -> Mapping[str, FloatArray]:
    """The open-circuit potential of an electrode in every installed lithium-ion set, on `GRID`, V, by the set."""
    found: dict[str, FloatArray] = {}
    for name in set_names():
        if name not in _NO_LITHIUM:
            curve = OcpCurves(pybamm.ParameterValues(name)).curve(which, CellChange())
            if np.all(np.isfinite(curve)):
                found[name] = curve
    return found


def distinct(curves: Mapping[str, FloatArray]) -> list[str]:
    """The names of curves, each curve once."""
    names: list[str] = []
    for name, curve in curves.items():
        if not any(np.allclose(curve, curves[other]) for other in names):
            names.append(name)
    return names


def _balanced(slow: SlowCurve, curves: Mapping[str, FloatArray]) -> tuple[float, dict[str, tuple[float, float]]]:
    """Root mean square misfit, V, and stoichiometries at which two potentials describe the curve best."""

    def misfit(at: FloatArray) -> FloatArray:
        x, y = at[0] + (at[1] - at[0]) * slow.share, at[2] + (at[3] - at[2]) * slow.share
        shown = np.interp(y, GRID, curves["Positive"]) - np.interp(x, GRID, curves["Negative"]) - slow.polarised * at[4]
        return np.asarray(shown - slow.voltage)

    fits = [
        least_squares(misfit, (*start, _POLARISATION_V), bounds=(_LOWEST, _HIGHEST), max_nfev=_EVALUATIONS)
        for start in _STARTS
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    full_n, empty_n, full_p, empty_p, _ = (float(value) for value in best.x)
    rms_v = float(np.sqrt(np.mean(best.fun**2)))
    return rms_v, {"Negative": (full_n, empty_n), "Positive": (full_p, empty_p)}


def misfit_of(base: ParameterSource, slow: SlowCurve) -> float | None:
    """What a set's own potentials leave of the slowest record, V; None if it has none."""
    values = load(base)
    if not all(callable(values[ocp_name(which)]) for which in ELECTRODES):
        return None
    own = OcpCurves(values)
    return _balanced(slow, {which: own.curve(which, CellChange()) for which in ELECTRODES})[0]


def with_potentials(base: ParameterSource, found: Potentials) -> ParameterFile:
    """A parameter set with other open-circuit potentials, and with electrodes balanced for them.

    The volume fractions of active material get the ratio of capacities that the record shows, their product
    unchanged as far as there is room; the initial concentrations are those of its fullest point. The size of the cell
    is not touched, and all else is that of ``base``.
    """
    values = load(base)
    fractions = {which: f"{which} electrode active material volume fraction" for which in ELECTRODES}
    larger: dict[str, float] = {}
    for which, fraction in fractions.items():
        highest = float(values[maximum_concentration(which)])
        full, empty = found.stoichiometry[which]
        own = float(values[fraction]) * float(values[f"{which} electrode thickness [m]"]) * highest
        larger[which] = 1.0 / (abs(full - empty) * own)
        values.update({initial_concentration(which): full * highest})
        values.update({ocp_name(which): load(found.sets[which])[ocp_name(which)]})
    mean = math.sqrt(math.prod(larger.values()))
    wanted = {fraction: float(values[fraction]) * larger[which] / mean for which, fraction in fractions.items()}
    room = min(1.0, _MOST / max(wanted.values()))
    values.update({fraction: room * value for fraction, value in wanted.items()})
    return ParameterFile(f"{base} with the potentials of {found}", "parameter-values", as_json(values))
