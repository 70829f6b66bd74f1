"""Which published open-circuit potentials describe a cell: those of installed sets, fitted to what records show."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from ....core.errors import BsaError, unknown
from ....core.reading.open_circuit import OpenCircuitCurve
from ....core.rms import rms
from ....core.target import CellChange, ocp_name
from ....core.task import NEAREST, ParameterFile, ParameterSource
from ....core.trajectory import FloatArray
from ..cells.ocp_shape import ELECTRODES, GRID, OcpCurves
from ..cells.parameter_files import as_json
from ..cells.parameter_sets import load, pybamm, set_names
from ..cells.state_of_charge import initial_concentration, maximum_concentration

_STARTS = ((0.9, 0.03, 0.27, 0.9), (0.85, 0.02, 0.2, 0.95), (0.75, 0.01, 0.4, 0.98))
"""Stoichiometries of a full and an empty cell from which a fit starts: negative, then positive electrode."""

_LOWEST, _HIGHEST = (0.4, 5e-4, 5e-4, 0.5, 0.0), (0.9995, 0.3, 0.6, 0.9995, 0.3)
"""Their bounds, and those of the polarisation, V: a cell uses most of both electrodes between its cut-offs, and what is
farther from a published curve than a tired cell's losses at 1C is another material."""

_LOSS_V, _LOSS_DEVIATION_V, _HYSTERESIS_V = 0.1, 0.07, 0.01
"""Polarisation of a charge or discharge of an hour (or less) and its standard deviation, V, of slower ones in
proportion to the current; and what the hysteresis of the potentials adds to the deviation at any rate.

One discharge does not tell polarisation from potentials that are higher by as much at all charges. With nothing known
of it the NMC pouch cell got 163 mV at C/20, potentials of another NMC, and electrodes a tenth too large; and other ones
at C/2 and 1C. Now all three records choose the potentials of Mohtat2020's positive electrode, as they do with half the
mean and with half the deviation. With twice the mean two of them choose Ecker2015's, with twice the deviation one does.
The choices for the Panasonic cell and the LG M50 stay in all of these.
"""

_MISFIT_V, _PIECES = 0.01, 10
"""What potentials of a cell's own chemistry leave, V, and parts of a curve in which this is independent: so much does
the curve tell of the polarisation."""

_EVALUATIONS = 100
"""Steps of such a fit at most: a pair that describes the cell needs twenty."""

_NO_LITHIUM = ("Chayambuka2022",)
"""Installed sets of sodium-ion cells: PyBaMM's sets do not say it."""

_MOST = 0.95
"""Largest volume fraction of active material."""


@dataclass(frozen=True)
class Potentials:
    """Open-circuit potentials of two published electrodes, balanced as a measured cell shows them."""

    # negative, positive: The sets that they are from.
    negative: str
    positive: str
    rms_v: float  # What they leave of the measured curve, V.
    cost: float  # Squared deviations of that and of the polarisation: the less, the likelier.
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


def usual_polarisation(curve: OpenCircuitCurve) -> tuple[float, float]:
    """Mean and standard deviation of the polarisation that is usual at the current of a curve, V."""
    rate = 1.0 / max(curve.hours, 1.0)
    return _LOSS_V * rate, _LOSS_DEVIATION_V * rate


def chosen_potentials(
    wanted: str, curve: OpenCircuitCurve | None, otherwise: str = "leave --ocp out"
) -> list[Potentials]:
    """Published potentials, those that describe a measured curve best first.

    ``wanted`` is ``"nearest"`` for the potentials of all installed sets, or the set, or two with a slash between them:
    ``"Mohtat2020/NCA_Kim2011"`` for the negative and the positive electrode. Raises `BsaError` if there is no such set,
    or no such curve: ``otherwise`` is then what to do without one.
    """
    if curve is None:
        raise BsaError(
            "no record shows open-circuit voltages over half of its charge.",
            "open-circuit potentials are chosen by a charge or discharge at 1C or less (best at C/10 or less), or by a "
            f"pulse test with rests of ten minutes: add one, or {otherwise}.",
        )
    known = {which: published_potentials(which) for which in ELECTRODES}
    if wanted == NEAREST:
        chosen = [distinct(known[which]) for which in ELECTRODES]
    else:
        names = wanted.split("/", 1)
        for which, name in zip(ELECTRODES, (names[0], names[-1]), strict=True):
            if name not in known[which]:
                message = f'"{name}" is no set with an open-circuit potential of the {which.lower()} electrode.'
                raise unknown(message, name, known[which], 'choose "nearest", or of {}.')
        chosen = [[names[0]], [names[-1]]]
    found = []
    for negative, positive in product(*chosen):
        pair = {"Negative": known["Negative"][negative], "Positive": known["Positive"][positive]}
        found.append(Potentials(negative, positive, *_balanced(curve, pair)))
    return sorted(found, key=lambda potentials: potentials.cost)


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


def _balanced(
    curve: OpenCircuitCurve, pair: Mapping[str, FloatArray]
) -> tuple[float, float, dict[str, tuple[float, float]]]:
    """Misfit, V (rms), cost, and stoichiometries at which two potentials describe the curve best."""
    usual_v, deviation_v = usual_polarisation(curve)
    deviation_v = math.hypot(deviation_v, _HYSTERESIS_V)
    unit = _MISFIT_V * math.sqrt(len(curve.share) / _PIECES)

    def misfit(at: FloatArray) -> FloatArray:
        x, y = at[0] + (at[1] - at[0]) * curve.share, at[2] + (at[3] - at[2]) * curve.share
        open_circuit = np.interp(y, GRID, pair["Positive"]) - np.interp(x, GRID, pair["Negative"])
        off = open_circuit - curve.polarised * at[4] - curve.voltage
        return np.append(off / unit, (at[4] - usual_v) / deviation_v)

    fits = [
        least_squares(misfit, (*start, usual_v), bounds=(_LOWEST, _HIGHEST), max_nfev=_EVALUATIONS) for start in _STARTS
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    full_n, empty_n, full_p, empty_p, _ = (float(value) for value in best.x)
    rms_v = unit * rms(best.fun[:-1])
    return rms_v, 2.0 * float(best.cost), {"Negative": (full_n, empty_n), "Positive": (full_p, empty_p)}


def misfit_of(base: ParameterSource, curve: OpenCircuitCurve) -> float | None:
    """What a set's own potentials leave of a measured curve, V; None if it has none."""
    values = load(base)
    if not all(callable(values[ocp_name(which)]) for which in ELECTRODES):
        return None
    own = OcpCurves(values)
    return _balanced(curve, {which: own.curve(which, CellChange()) for which in ELECTRODES})[0]


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
