"""What is usually uncertain about a cell whose design is known: the default parameters of a discovery's base fit."""

from collections.abc import Mapping, Sequence

from ....core.contracts.requests import MeasuredRecord
from ....core.errors import BsaError, did_you_mean
from ....core.inference.current_offset import current_offset
from ....core.parameters import Parameter, ParameterSpace
from ....core.target import CYCLABLE_LITHIUM, InitialSoc, target_named

_SPREADS = {
    "Negative electrode active material volume fraction factor": (0.15, 0.5, 1.8),
    "Positive electrode active material volume fraction factor": (0.15, 0.5, 1.8),
    CYCLABLE_LITHIUM: (0.08, 0.7, 1.3),
    "Negative particle diffusivity [m2.s-1] factor": (0.7, 0.03, 30.0),
    "Positive particle diffusivity [m2.s-1] factor": (0.7, 0.03, 30.0),
    "Negative electrode exchange-current density [A.m-2] factor": (0.7, 0.03, 30.0),
    "Positive electrode exchange-current density [A.m-2] factor": (0.7, 0.03, 30.0),
    "Electrolyte conductivity [S.m-1] factor": (0.15, 0.5, 2.0),
    "Electrolyte diffusivity [m2.s-1] factor": (0.3, 0.4, 2.5),
}
"""Standard deviation of the logarithm, lower and upper bound of each factor.

Active material and lithium are known to the few percent to which capacity is; diffusivities and exchange currents,
from one simulator to the next, to a factor of two; the electrolyte's bulk properties are measured to 20 %. Particle
radii and thicknesses are left out: in these models a radius acts through ``D / R^2`` and ``j0 / R`` only, and a
thickness through the capacity and the electrolyte's resistance, all of which are here.
"""

UNKNOWN_SOC = 0.9
"""State of charge at which a record is taken to start where nothing tells it."""

_CAPACITY = (
    "Negative electrode active material volume fraction factor",
    "Positive electrode active material volume fraction factor",
    CYCLABLE_LITHIUM,
)

PRESETS: dict[str, dict[str, tuple[float, float, float]]] = {
    "all": _SPREADS,
    "capacity": {name: _SPREADS[name] for name in _CAPACITY},
    "particles": {name: spread for name, spread in _SPREADS.items() if not name.startswith("Electrolyte")},
    "measured": {name: (0.5 * spread, lower, upper) for name, (spread, lower, upper) in _SPREADS.items()},
    "unchanged": {name: (0.1 * spread, lower, upper) for name, (spread, lower, upper) in _SPREADS.items()},
}
"""What may be uncertain, by name: everything; the electrodes' capacities alone, where transport and kinetics were
measured on the cell; everything but the electrolyte; everything, but half as much, where the set was measured on cells
of this very type, and a tenth, where an earlier record of the cell is the reference."""


def default_spread(name: str) -> tuple[float, float, float]:
    """Deviation of the logarithm, lower and upper bound of a default parameter.

    Raises `BsaError` if there is no default for it.
    """
    if name not in _SPREADS:
        hint = did_you_mean(name, _SPREADS) or "give it a spread, a lower and an upper bound."
        raise BsaError(f'"{name}" is not an uncertain parameter by default.', hint)
    return _SPREADS[name]


def uncertain_parameters(
    measured_records: Sequence[MeasuredRecord],
    soc: Mapping[str, float] | None = None,
    spreads: Mapping[str, tuple[float, float, float]] | None = None,
) -> ParameterSpace:
    """What the base fit moves: factors of 1, each record's initial charge, and what rounding hides of its current.

    ``soc`` is, by record, where the search for its initial state of charge starts; 0.9 for those not named.
    ``spreads`` are the deviation of the logarithm, lower and upper bound of each factor; the nine defaults if left out.
    """
    factors = [
        Parameter(
            name, 1.0, lower, upper, "log", target_named(name), spread, prior=True, difference=min(0.1, 0.03 / spread)
        )
        for name, (spread, lower, upper) in (spreads or _SPREADS).items()
    ]
    starts = soc or {}
    states = [
        Parameter(s.soc_name, starts.get(s.name, UNKNOWN_SOC), 0.0, 1.08, target=InitialSoc(s.name), deviation=0.02)
        for s in measured_records
    ]
    offsets = [offset for offset in map(current_offset, measured_records) if offset is not None]
    return ParameterSpace((*factors, *states, *offsets))
