"""Published open-circuit potentials, corrected until they describe the slow curve of a measured cell.

The graphite of two makers has its steps at other stoichiometries, and no published potential is that of another cell's
material: balanced as well as they can be, they leave 8 to 14 mV of a curve at C/20. Where that was measured, both
potentials get smooth corrections, narrow enough for such steps. One curve does not tell how the two electrodes share
what is left: they share it as their priors do, the more where potentials are known to differ.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from ....core.reading.open_circuit import OpenCircuitCurve
from ....core.rms import rms
from ....core.target import ocp_name
from ....core.trajectory import FloatArray
from ..cells.ocp_shape import ELECTRODES, bump, corrected, nearest_within, room_to_rise, slopes_of_bumps
from .balance import HIGHEST, LOWEST, Balance, along, off_curve, unusual, usual_polarisation

_WIDTH, _APART = 0.6, 0.9
"""Standard deviation of a correction's bumps and their distance, in ``ln(x / (1 - x))``. Of three cells' curves at C/20
(an LFP cell, the NMC pouch and the Panasonic cell) 1.0, 1.1 and 1.7 mV are left; with 0.9 and 1.4, the bumps of a
search, 1.4, 2.2 and 3.1; with 0.45 and 0.65 0.8, 1.0 and 1.4."""

_OUTERMOST = 6.5
"""Place of the last bumps, as ``ln(x / (1 - x))``: a stoichiometry of 0.0015 from either end."""

_MIDDLE_V, _END_V = 0.03, 0.1
"""Standard deviation of potentials of one chemistry in the middle and at both ends, V; see search_presets.yaml."""

_MIDDLE, _END = 3.0, 4.6
"""Up to where the middle reaches and from where the ends begin, as ``ln(x / (1 - x))``: stoichiometries 0.05 and 0.01
(0.95 and 0.99)."""

_AHEAD_H = 0.2
"""By how much the surface of a particle is ahead of its mean, as a share of the charge at a current of one charge an
hour; in proportion to the current 1 % at C/20. By diffusion it is R^2 / 15 D over an hour, in most electrodes of the
installed sets 0.01 to 0.3, and the larger ones count. Where a cell runs empty the voltage moves by tenths of a volt
with it: there the curve is not that of the potentials."""

_LEAST_V = 0.001
"""What a curve is off by at least at each of its points, V: its digits, and what hours of rest have not reached."""

_UNLIKELY = 2.0
"""What potentials leave, in units of what a curve may be off by, from which they are corrected."""

FAR_V = 0.05
"""Misfit from which potentials are those of other materials, V, and are not corrected: the measured cells of
docs/real-cells-results.md left 4 to 20 mV."""

_EVALUATIONS = 60
"""Steps of a fit at most: the measured curves need ten to thirty."""

_PLACES = np.arange(-_OUTERMOST, _OUTERMOST + 0.5 * _APART, _APART)
_CENTRES: FloatArray = 1.0 / (1.0 + np.exp(-_PLACES))
"""Stoichiometries of an electrode's bumps, shape (k / 2,)."""

_BEYOND = np.clip((np.abs(_PLACES) - _MIDDLE) / (_END - _MIDDLE), 0.0, 1.0)
_DEVIATIONS: FloatArray = np.tile(_MIDDLE_V + (_END_V - _MIDDLE_V) * _BEYOND, len(ELECTRODES))
"""Standard deviations of the heights of both electrodes, V, shape (k,)."""


@dataclass(frozen=True, eq=False)
class Corrections:
    """Corrections of two potentials, and the balance that belongs to them."""

    balance: Balance
    heights: Mapping[str, Mapping[float, float]]  # Of each electrode's bumps, V, by their stoichiometry.

    def correct(self, values: Any) -> None:
        """Put the corrections into a parameter set, in place."""
        for which, heights in self.heights.items():
            name = ocp_name(which)
            values.update({name: corrected(values[name], heights, _WIDTH)})


def lacks(curve: OpenCircuitCurve, balance: Balance) -> bool:
    """Whether two potentials, balanced, are off a curve by more than polarisation explains, and yet near it."""
    return _UNLIKELY * _polarisation_v(curve) < balance.rms_v < FAR_V


def _polarisation_v(curve: OpenCircuitCurve) -> float:
    """By how much the polarisation of a curve changes along it, V.

    By as much as the polarisation of one cell differs from that of another: 3.5 mV at C/20, 7 mV at C/10.
    """
    _, deviation_v = usual_polarisation(curve)
    return max(deviation_v, _LEAST_V)


def _off_by(curve: OpenCircuitCurve) -> FloatArray:
    """What a curve may be off by at each of its points, V, shape (n,)."""
    ahead = _AHEAD_H / curve.hours * np.abs(np.gradient(curve.voltage, curve.share))
    return np.hypot(_polarisation_v(curve), ahead)


def corrections(curve: OpenCircuitCurve, pair: Mapping[str, FloatArray], begin: Balance) -> Corrections:
    """The likeliest corrections of two potentials, on `GRID`, with which they describe a curve.

    They and their balance are fitted together, from the balance without them, ``begin``, on; what they leave is a mean
    in which each point counts by what the curve may be off by there. The potentials keep falling with stoichiometry:
    of corrections that would not let them, the nearest that do are taken, as the curve and the priors measure the
    distance.
    """
    off_by = _off_by(curve)

    def misfit(point: FloatArray) -> FloatArray:
        at, heights = point[:5], point[5:]
        off = off_curve(curve, pair, at) + _effect(curve, at) @ heights
        return np.concatenate([off / off_by, unusual(curve, at), heights / _DEVIATIONS])

    start = np.concatenate([begin.at, np.zeros(len(_DEVIATIONS))])
    free = np.full(len(_DEVIATIONS), np.inf)
    bounds = (np.concatenate([LOWEST, -free]), np.concatenate([HIGHEST, free]))
    found = least_squares(misfit, start, bounds=bounds, max_nfev=_EVALUATIONS)
    at, heights = found.x[:5], found.x[5:]
    effect = _effect(curve, at)
    # Distances as the cost of the fit has them: its Cholesky factor makes them those of the plane.
    seen = effect / off_by[:, None]
    factor = np.linalg.cholesky(seen.T @ seen + np.diag(_DEVIATIONS**-2.0)).T
    slopes = block_diag(*[slopes_of_bumps(_CENTRES, _WIDTH) for _ in ELECTRODES])
    room = np.concatenate([room_to_rise(pair[which]) for which in ELECTRODES])
    heights = np.linalg.solve(factor, nearest_within(factor @ heights, slopes @ np.linalg.inv(factor), room))
    left_v = rms((off_curve(curve, pair, at) + effect @ heights) / off_by) / rms(1.0 / off_by)
    return Corrections(Balance(at, left_v, 2.0 * float(found.cost)), _by_electrode(heights))


def _effect(curve: OpenCircuitCurve, at: FloatArray) -> FloatArray:
    """What a height of each bump of both electrodes adds to the voltage along a curve, shape (n, k)."""
    x = along(curve, at)
    negative, positive = (bump(x[which][:, None], _CENTRES, _WIDTH) for which in ELECTRODES)
    return np.hstack([-negative, positive])


def _by_electrode(heights: FloatArray) -> dict[str, dict[float, float]]:
    """Heights by electrode and stoichiometry."""
    parts = zip(ELECTRODES, np.split(heights, len(ELECTRODES)), strict=True)
    return {which: dict(zip(_CENTRES.tolist(), part.tolist(), strict=True)) for which, part in parts}
