"""One benchmark case: a base cell, what was changed in it, and how it is cycled."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from ...core.parameters import Candidate
from ...core.task import Protocol

MODEL_OPTIONS = {"SEI": "reaction limited", "SEI film resistance": "distributed"}
"""The paper's model options, the same for every case but those of `_OWN_GROWTH`."""

_OWN_GROWTH = {"SEI solvent diffusivity [m2.s-1]": "solvent-diffusion limited"}
"""What limits the growth of the SEI where a hidden parameter says so: under any other law it takes no part, and the
record would be that of the base cell."""

_AMBIENT = ("Ambient temperature [K]", "Initial temperature [K]")


@dataclass(frozen=True)
class SuiteCase:
    """A benchmark case; the truth in it is never shown to a proposer."""

    mode: str  # How the truth was made. One of 'regular', 'extreme', 'sei', 'random', 'life'.
    number: int  # Identifier within its mode.
    parameter_set: str  # The base cell, where every search starts.
    # charge_rate, discharge_rate: C-rates of the constant-current steps.
    charge_rate: float
    discharge_rate: float
    changes: Mapping[str, float]  # The true values of the parameters that differ from the base cell.
    cycles: int = 2  # Cycles of the protocol.
    noise_v: float = 0.0  # Standard deviation of the noise on the target's voltage, V.
    growth: Mapping[str, str] = field(default_factory=dict)  # Model options of what ages it, where not the paper's.

    @property
    def ages(self) -> bool:
        """Whether it is a whole life, compared cycle by cycle."""
        return self.mode in ("sei", "life")

    @property
    def key(self) -> str:
        """``"regular-134"``."""
        return f"{self.mode}-{self.number}"

    @property
    def rates(self) -> str:
        """``"2C/1C"``: charge and discharge."""
        return f"{self.charge_rate:g}C/{self.discharge_rate:g}C"

    @property
    def hidden(self) -> Candidate:
        """The true values that a search is to find: the changes without the known ambient temperature."""
        return {name: value for name, value in self.changes.items() if name not in _AMBIENT}

    @property
    def options(self) -> dict[str, str]:
        """PyBaMM's model options: those under which what is hidden takes part."""
        own = next((law for name, law in _OWN_GROWTH.items() if name in self.changes), MODEL_OPTIONS["SEI"])
        return {**MODEL_OPTIONS, "SEI": own, **self.growth}

    @property
    def temperature_k(self) -> float | None:
        """The ambient temperature, which any laboratory knows; None for the base cell's."""
        return next((float(self.changes[name]) for name in _AMBIENT if name in self.changes), None)


def protocol(charge_rate: float, discharge_rate: float, highest_v: float, lowest_v: float, cycles: int = 2) -> Protocol:
    """The paper's cycle, as PyBaMM step strings."""
    cycle = (
        "Rest for 1 second",
        f"Charge at {charge_rate:g}C until {highest_v:g} V",
        "Rest for 1 second",
        f"Hold at {highest_v:g} V until C/20",
        "Rest for 90 seconds",
        f"Discharge at {discharge_rate:g}C until {lowest_v:g} V",
        "Rest for 90 seconds",
    )
    return (cycle,) * cycles
