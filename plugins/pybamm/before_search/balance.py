"""Between which stoichiometries two electrodes work in a measured cell, from its open-circuit curve."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ....core.reading.open_circuit import OpenCircuitCurve
from ....core.rms import rms
from ....core.trajectory import FloatArray
from ..cells.ocp_shape import GRID

_STARTS = ((0.9, 0.03, 0.27, 0.9), (0.85, 0.02, 0.2, 0.95), (0.75, 0.01, 0.4, 0.98))
"""Stoichiometries of a full and an empty cell from which a fit starts: negative, then positive electrode."""

LOWEST, HIGHEST = (0.4, 5e-4, 5e-4, 0.5, 0.0), (0.9995, 0.3, 0.6, 0.9995, 0.3)
"""Their bounds, and those of the polarisation, V: a cell uses most of both electrodes between its cut-offs, and what is
farther from a published curve than a tired cell's losses at 1C is another material."""

_USUAL, _DEVIATION = np.array((0.87, 0.02, 0.27, 0.91)), np.array((0.08, 0.03, 0.15, 0.08))
"""Means and standard deviations of these stoichiometries in the installed sets of lithium-ion cells. A flat potential
(LFP) does not tell them: without this the positive electrode of a measured LFP cell is twice as large as needed."""

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


@dataclass(frozen=True, eq=False)
class Balance:
    """Stoichiometries and polarisation at which two potentials describe a curve best."""

    # Stoichiometries of the negative and of the positive electrode, each at the fullest and the emptiest point of the
    # curve, and the polarisation, V; shape (5,).
    at: FloatArray
    rms_v: float  # What is left of the curve, V.
    cost: float  # Squared deviations of that, and of what is usual: the less, the likelier.

    @property
    def stoichiometry(self) -> dict[str, tuple[float, float]]:
        """Of each electrode, at the fullest and at the emptiest point."""
        full_n, empty_n, full_p, empty_p, _ = self.at.tolist()
        return {"Negative": (full_n, empty_n), "Positive": (full_p, empty_p)}


def usual_polarisation(curve: OpenCircuitCurve) -> tuple[float, float]:
    """Mean and standard deviation of the polarisation that is usual at the current of a curve, V."""
    rate = 1.0 / max(curve.hours, 1.0)
    return _LOSS_V * rate, _LOSS_DEVIATION_V * rate


def unusual(curve: OpenCircuitCurve, at: FloatArray) -> FloatArray:
    """How far stoichiometries and polarisation (`Balance.at`) are from usual ones, in standard deviations."""
    usual_v, deviation_v = usual_polarisation(curve)
    polarisation = (at[4] - usual_v) / math.hypot(deviation_v, _HYSTERESIS_V)
    return np.append((at[:4] - _USUAL) / _DEVIATION, polarisation)


def along(curve: OpenCircuitCurve, at: FloatArray) -> dict[str, FloatArray]:
    """The stoichiometry of each electrode along a curve, shape (n,)."""
    return {"Negative": at[0] + (at[1] - at[0]) * curve.share, "Positive": at[2] + (at[3] - at[2]) * curve.share}


def off_curve(curve: OpenCircuitCurve, pair: Mapping[str, FloatArray], at: FloatArray) -> FloatArray:
    """By how much two potentials, on `GRID`, lie above a curve, V, shape (n,)."""
    place = along(curve, at)
    open_circuit = np.interp(place["Positive"], GRID, pair["Positive"]) - np.interp(
        place["Negative"], GRID, pair["Negative"]
    )
    return np.asarray(open_circuit - curve.polarised * at[4] - curve.voltage)


def balanced(curve: OpenCircuitCurve, pair: Mapping[str, FloatArray]) -> Balance:
    """The balance at which two potentials, on `GRID`, describe a curve best."""
    unit = _MISFIT_V * math.sqrt(len(curve.share) / _PIECES)

    def misfit(at: FloatArray) -> FloatArray:
        return np.append(off_curve(curve, pair, at) / unit, unusual(curve, at))

    usual_v, _ = usual_polarisation(curve)
    fits = [
        least_squares(misfit, (*start, usual_v), bounds=(LOWEST, HIGHEST), max_nfev=_EVALUATIONS) for start in _STARTS
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    return Balance(best.x, rms(off_curve(curve, pair, best.x)), 2.0 * float(best.cost))
