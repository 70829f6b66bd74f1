"""Which published open-circuit potentials describe a cell: those of installed sets, fitted to what records show."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np

from ....core.errors import BsaError, unknown
from ....core.reading.open_circuit import OpenCircuitCurve
from ....core.target import CellChange, ocp_name
from ....core.task import NEAREST, ParameterFile, ParameterSource
from ....core.trajectory import FloatArray
from ..cells.ocp_shape import ELECTRODES, OcpCurves
from ..cells.parameter_files import as_json
from ..cells.parameter_sets import load, pybamm, set_names
from ..cells.state_of_charge import initial_concentration, maximum_concentration
from .balance import Balance, balanced
from .measured_potentials import Corrections, corrections, lacks

_NO_LITHIUM = ("Chayambuka2022",)
"""Installed sets of sodium-ion cells: PyBaMM's sets do not say it."""

_MOST = 0.95
"""Largest volume fraction of active material."""


@dataclass(frozen=True, eq=False)
class Potentials:
    """Open-circuit potentials of two electrodes, balanced as a measured cell shows them."""

    sets: Mapping[str, str]  # That of each electrode.
    curves: Mapping[str, FloatArray]  # By electrode, on `GRID`, V.
    uncorrected: Balance  # Where the electrodes work along the measured curve, and what is left of that.
    corrections: Corrections | None = None  # What a slow curve shows that the sets lack.

    @property
    def balance(self) -> Balance:
        """Where the electrodes work along the measured curve, with the corrections if there are any."""
        return self.uncorrected if self.corrections is None else self.corrections.balance

    @property
    def rms_v(self) -> float:
        """What they leave of the measured curve, V."""
        return self.balance.rms_v

    def corrected_by(self, curve: OpenCircuitCurve) -> Potentials:
        """The same with the corrections that a curve shows, and balanced with them.

        As they are if polarisation explains what they leave, or if they are those of other materials.
        """
        if not lacks(curve, self.uncorrected):
            return self
        return replace(self, corrections=corrections(curve, self.curves, self.uncorrected))

    def __str__(self) -> str:
        negative, positive = (self.sets[which] for which in ELECTRODES)
        return negative if negative == positive else f"{negative} (negative) and {positive} (positive)"


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
            "pulse test with rests of ten minutes (if another file holds the discharges between its pulses, say "
            f"--join): add one, or {otherwise}.",
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
    for both in product(*chosen):
        sets = dict(zip(ELECTRODES, both, strict=True))
        pair = {which: known[which][name] for which, name in sets.items()}
        found.append(Potentials(sets, pair, balanced(curve, pair)))
    return sorted(found, key=lambda potentials: potentials.uncorrected.cost)


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


def own_potentials(base: ParameterSource, curve: OpenCircuitCurve) -> Potentials | None:
    """A set's own potentials, balanced as a measured curve shows; None if it has none."""
    values = load(base)
    if not all(callable(values[ocp_name(which)]) for which in ELECTRODES):
        return None
    own = OcpCurves(values)
    pair = {which: own.curve(which, CellChange()) for which in ELECTRODES}
    return Potentials(dict.fromkeys(ELECTRODES, str(base)), pair, balanced(curve, pair))


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
        full, empty = found.balance.stoichiometry[which]
        own = float(values[fraction]) * float(values[f"{which} electrode thickness [m]"]) * highest
        larger[which] = 1.0 / (abs(full - empty) * own)
        values.update({initial_concentration(which): full * highest})
        if found.sets[which] != str(base):
            values.update({ocp_name(which): load(found.sets[which])[ocp_name(which)]})
    if found.corrections is not None:
        found.corrections.correct(values)
    mean = math.sqrt(math.prod(larger.values()))
    wanted = {fraction: float(values[fraction]) * larger[which] / mean for which, fraction in fractions.items()}
    room = min(1.0, _MOST / max(wanted.values()))
    values.update({fraction: room * value for fraction, value in wanted.items()})
    whose = f"the potentials of {found}"
    if found.corrections is not None:
        whose = "corrected potentials" if str(found) == str(base) else f"the corrected potentials of {found}"
    return ParameterFile(f"{base} with {whose}", "parameter-values", as_json(values))
