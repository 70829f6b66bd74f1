"""What a hidden cell may have that its base model lacks: PyBaMM's own options, or the equation written out here.

Nothing here comes from the catalogue that is under test, neither code nor values: only the names are shared, so that an
answer can be graded. The equations are those that the catalogue documents; a test compares curves.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pybamm

from ...core.trajectory import FloatArray

Kind = Literal["any", "thermal", "ambients", "ageing", "charge"]
"""What records an effect needs to be seen at all: any, with high currents, at several temperatures, of many cycles, or
with charges and discharges."""

_FARADAY, _GAS, _BOLTZMANN_EV = 96485.33212, 8.314462618, 8.617333262e-5
_REFERENCE_K = 298.15

_TRANSPORT_AND_KINETICS = (
    "Negative particle diffusivity [m2.s-1]",
    "Positive particle diffusivity [m2.s-1]",
    "Negative electrode exchange-current density [A.m-2]",
    "Positive electrode exchange-current density [A.m-2]",
    "Electrolyte diffusivity [m2.s-1]",
    "Electrolyte conductivity [S.m-1]",
)


@dataclass(frozen=True)
class HiddenEffect:
    """One effect of a hidden cell."""

    key: str  # Its name in the catalogue, with the variant in brackets.
    strength: str  # The catalogue's name of its strength, with the unit.
    # low, high: Range of the strength's distance from its null value, for a cell of 5 A.h.
    low: float
    high: float
    null: float = 0.0  # The strength at which there is no effect.
    signed: bool = False  # Whether nature allows both signs.
    scale: Literal["", "current", "resistance"] = ""  # How the strength goes with the size of the cell.
    records: Kind = "any"  # What records it needs.
    models: tuple[str, ...] = ("SPMe", "DFN")  # Base models that it can be hidden from.
    # Whether it is hidden without a second one: the two are costly to simulate or need other base models.
    alone: bool = False
    model: str = ""  # Model of the hidden cell, where it is another than the base model.
    options: Mapping[str, str] = field(default_factory=dict)  # PyBaMM's options.
    # ``prepare(values, strength, ambient_k)`` changes the parameter values.
    prepare: Callable[[Any, float, float], None] | None = None
    # ``voltage(time, current, strength, capacity)``: volts added to the terminal voltage.
    voltage: Callable[[FloatArray, FloatArray, float, float], FloatArray] | None = None
    # ``instrument(time, current, voltage, strength)``: current and voltage as they are recorded.
    instrument: Callable[[FloatArray, FloatArray, FloatArray, float], tuple[FloatArray, FloatArray]] | None = None
    # Mesh points by PyBaMM's name of the coordinate, where the cell's own number would take minutes.
    points: Mapping[str, int] = field(default_factory=dict)
    leak: bool = False  # Whether the strength is a current that bypasses the cycler, A.

    @property
    def name(self) -> str:
        """The key without its variant."""
        return self.key.partition(" (")[0]


def multiplied(value: Any, factor: Callable[..., Any]) -> Callable[..., Any]:
    """A parameter, number or function, times ``factor`` of the same arguments."""

    def function(*arguments: Any) -> Any:
        return (value(*arguments) if callable(value) else value) * factor(*arguments)

    return function


def _in_proportion(factor: float, *names: str) -> Callable[[Any, float, float], None]:
    """Gives parameters the strength times a factor as their value."""

    def prepare(values: Any, strength: float, ambient_k: float) -> None:
        for name in names:
            values[name] = factor * strength

    return prepare


def _cooling(values: Any, strength: float, ambient_k: float) -> None:
    values["Total heat transfer coefficient [W.m-2.K-1]"] = 1.0 / (strength * values["Cell cooling surface area [m2]"])


def _arrhenius(values: Any, strength: float, ambient_k: float) -> None:
    # The cell is isothermal, so that its temperature is the ambient one and the law a number.
    factor = float(np.exp(1e3 * strength / _GAS * (1 / _REFERENCE_K - 1 / ambient_k)))
    for name in _TRANSPORT_AND_KINETICS:
        values[name] = multiplied(values[name], lambda *arguments: factor)


def _hysteresis(time: FloatArray, current: FloatArray, strength: float, capacity: float) -> FloatArray:
    """One-state hysteresis with a decay of 20 per capacity, integrated exactly from sample to sample."""
    state = np.zeros(len(time))
    for k in range(1, len(time)):
        mean = 0.5 * (current[k] + current[k - 1])
        decay = np.exp(-20.0 * abs(mean) * (time[k] - time[k - 1]) / (3600.0 * capacity))
        state[k] = np.sign(mean) + (state[k - 1] - np.sign(mean)) * decay if mean else state[k - 1]
    return -strength * state


def _sizes(values: Any, strength: float, ambient_k: float) -> None:
    radii = [float(values[f"{which} particle radius [m]"]) for which in ("Negative", "Positive")]
    pybamm.get_size_distribution_parameters(
        values, R_n_av=radii[0], R_p_av=radii[1], sd_n=strength, sd_p=strength, R_min_n=0.1, R_min_p=0.1,
        R_max_n=1 + 5 * strength, R_max_p=1 + 5 * strength,
    )  # fmt: skip


def _electrolyte(values: Any, strength: float, ambient_k: float) -> None:
    for name in ("Electrolyte conductivity [S.m-1]", "Electrolyte diffusivity [m2.s-1]"):
        values[name] = multiplied(values[name], lambda *arguments: 1.0 / strength)


def _diffusivity(which: str, law: Callable[[Any, float], Any]) -> Callable[[Any, float, float], None]:
    def prepare(values: Any, strength: float, ambient_k: float) -> None:
        name = f"{which} particle diffusivity [m2.s-1]"
        values[name] = multiplied(values[name], lambda stoichiometry, temperature: law(stoichiometry, strength))

    return prepare


def _marcus(values: Any, strength: float, ambient_k: float) -> None:
    energy = 1.0 / strength
    # The cell is isothermal: PyBaMM's form lacks this factor at its temperature.
    normal = float(np.exp(energy / (4.0 * _BOLTZMANN_EV * ambient_k)))
    for which in ("Negative", "Positive"):
        name = f"{which} electrode exchange-current density [A.m-2]"
        values[name] = multiplied(values[name], lambda *arguments: normal)
        values[f"{which} electrode reorganization energy [eV]"] = energy


def _plating(values: Any, strength: float, ambient_k: float) -> None:
    def exchange(c_e: Any, c_li: Any, temperature: Any) -> Any:
        return _FARADAY * 1e-11 * strength * c_e

    values.update(
        {
            "Exchange-current density for plating [A.m-2]": exchange,
            "Lithium plating transfer coefficient": 0.65,
            "Lithium metal partial molar volume [m3.mol-1]": 1.3e-5,
            "Initial plated lithium concentration [mol.m-3]": 0.0,
            "Typical plated lithium concentration [mol.m-3]": 1000.0,
        },
        check_already_exists=False,
    )


def _lost(which: str) -> Callable[[Any, float, float], None]:
    other = {"Negative": "Positive", "Positive": "Negative"}[which]

    def prepare(values: Any, strength: float, ambient_k: float) -> None:
        area = float(values["Electrode width [m]"]) * float(values["Electrode height [m]"])
        area *= float(values["Number of electrodes connected in parallel to make a cell"])
        full = float(values[f"{which} electrode active material volume fraction"])
        coulombs = 3600.0 * float(values["Nominal cell capacity [A.h]"])

        def rate(current_density: Any, temperature: Any) -> Any:
            return -strength * full * abs(current_density) * area / coulombs

        values.update(
            {f"{which} electrode current-driven LAM rate": rate, f"{other} electrode current-driven LAM rate": 0.0},
            check_already_exists=False,
        )

    return prepare


def _clogging(values: Any, strength: float, ambient_k: float) -> None:
    turned_over = pybamm.Variable("Throughput capacity [A.h]") / float(values["Nominal cell capacity [A.h]"])
    for name, power in (
        ("Electrolyte conductivity [S.m-1]", 1.5),
        ("Electrolyte diffusivity [m2.s-1]", 0.5),
        ("Thermodynamic factor", 1.0),
    ):
        narrow = pybamm.exp(-power * strength * turned_over)
        values[name] = multiplied(values[name], lambda *arguments, narrow=narrow: narrow)
    # In less electrolyte the same reaction moves the salt further. The thermodynamic factor takes back what the anions'
    # share does to the potential.
    cations = values["Cation transference number"]

    def fewer(*arguments: Any) -> Any:
        share = cations(*arguments) if callable(cations) else cations
        return 1.0 - (1.0 - share) * pybamm.exp(strength * turned_over)

    values["Cation transference number"] = fewer


def _late(time: FloatArray, current: FloatArray, voltage: FloatArray, strength: float) -> tuple[FloatArray, FloatArray]:
    # A step's last sample and the next one's first may carry the same stamp: a microsecond apart they stay in order.
    return current, np.interp(time - strength, time + 1e-6 * np.arange(len(time)), voltage)


EFFECTS: tuple[HiddenEffect, ...] = (
    HiddenEffect(
        "contact-resistance", "contact-resistance: resistance [Ohm]", 5e-4, 4.5e-2, scale="resistance",
        options={"contact resistance": "true"}, prepare=_in_proportion(1.0, "Contact resistance [Ohm]"),
    ),
    HiddenEffect(
        "self-heating", "self-heating: thermal_resistance [K.W-1]", 1.0, 15.0, scale="resistance", records="thermal",
        options={"thermal": "lumped"}, prepare=_cooling,
    ),
    HiddenEffect(
        "temperature-dependence", "temperature-dependence: activation_energy [kJ.mol-1]", 3.0, 60.0,
        records="ambients", prepare=_arrhenius,
    ),
    HiddenEffect(
        "double-layer-capacitance", "double-layer-capacitance: capacitance [F.m-2]", 2.0, 150.0,
        options={"surface form": "differential"},
        prepare=_in_proportion(
            1.0, "Negative electrode double-layer capacity [F.m-2]", "Positive electrode double-layer capacity [F.m-2]"
        ),
    ),
    HiddenEffect("ocp-hysteresis", "ocp-hysteresis: half_gap [V]", 1e-3, 6e-2, records="charge", voltage=_hysteresis),
    HiddenEffect(
        "particle-size-distribution", "particle-size-distribution: deviation", 0.15, 0.6, models=("SPMe",), alone=True,
        options={"particle size": "distribution", "surface form": "algebraic"}, prepare=_sizes,
        points={"R_n": 25, "R_p": 25, "r_n": 60, "r_p": 60},
    ),
    HiddenEffect(
        "electrolyte-transport", "electrolyte-transport: resistance_factor", 0.1, 3.0, models=("SPM",), alone=True,
        model="SPMe", prepare=_electrolyte,
    ),
    *(
        HiddenEffect(
            f"solid-diffusivity-variation ({which.lower()} electrode)", "solid-diffusivity-variation: log_slope",
            0.2, 6.0, signed=True,
            prepare=_diffusivity(which, lambda stoichiometry, slope: pybamm.exp(slope * (stoichiometry - 0.5))),
        )
        for which in ("Negative", "Positive")
    ),
    *(
        HiddenEffect(
            f"stress-induced-diffusion ({which.lower()} electrode)", "stress-induced-diffusion: coupling",
            0.2, 9.0, prepare=_diffusivity(which, lambda stoichiometry, coupling: 1.0 + coupling * stoichiometry),
        )
        for which in ("Negative", "Positive")
    ),
    HiddenEffect(
        "kinetics-marcus", "kinetics-marcus: inverse_reorganisation_energy [eV-1]", 0.5, 9.0, records="thermal",
        options={"intercalation kinetics": "Marcus"}, prepare=_marcus,
    ),
    HiddenEffect(
        "sei-growth (reaction-limited)", "sei-growth: rate", 3.0, 180.0, records="ageing",
        options={"SEI": "reaction limited"},
        prepare=_in_proportion(1.5e-7, "SEI reaction exchange current density [A.m-2]"),
    ),
    HiddenEffect(
        "sei-growth (diffusion-limited)", "sei-growth: rate", 60.0, 9000.0, records="ageing",
        options={"SEI": "solvent-diffusion limited"},
        prepare=_in_proportion(2.5e-22, "SEI solvent diffusivity [m2.s-1]"),
    ),
    HiddenEffect(
        "lithium-plating", "lithium-plating: rate", 10.0, 900.0, records="ageing",
        options={"lithium plating": "irreversible"}, prepare=_plating,
    ),
    *(
        HiddenEffect(
            f"loss-of-active-material ({which.lower()} electrode)", "loss-of-active-material: loss", 3e-4, 1e-2,
            records="ageing", options={"loss of active material": "current-driven"}, prepare=_lost(which),
        )
        for which in ("Negative", "Positive")
    ),
    HiddenEffect(
        "porosity-change", "porosity-change: loss", 1e-3, 3e-2, records="ageing",
        options={"calculate discharge energy": "true"}, prepare=_clogging,
    ),
    HiddenEffect("self-discharge", "self-discharge: leak [A]", 3e-3, 0.15, scale="current", leak=True),
    HiddenEffect(
        "current-gain", "current-gain: gain", 3e-3, 0.1, null=1.0, signed=True,
        instrument=lambda time, current, voltage, gain: (current / gain, voltage),
    ),
    HiddenEffect(
        "current-offset", "current-offset: offset [A]", 3e-3, 0.15, signed=True, scale="current",
        instrument=lambda time, current, voltage, offset: (current - offset, voltage),
    ),
    HiddenEffect(
        "voltage-offset", "voltage-offset: offset [V]", 1e-3, 4.5e-2, signed=True,
        instrument=lambda time, current, voltage, offset: (current, voltage + offset),
    ),
    HiddenEffect("time-lag", "time-lag: lag [s]", 0.15, 6.0, signed=True, instrument=_late),
)  # fmt: skip
"""All that may be hidden and named. The ranges reach from just visible to three times what is plain to see."""


def _empty_resistance(model: Any, strength: float) -> Any:
    """A series resistance that grows towards an empty cell."""
    lithiation = model.variables["Average negative particle stoichiometry"]
    return -strength * model.variables["C-rate"] * 4.0 * pybamm.exp(-6.0 * lithiation)


def _rectifying_contact(model: Any, strength: float) -> Any:
    """An overpotential that saturates with the current."""
    return -strength * pybamm.tanh(model.variables["C-rate"] / 0.3)


def _slow_memory(model: Any, strength: float) -> Any:
    """A voltage with a memory of twenty minutes, in proportion to the smoothed current."""
    state = pybamm.Variable("Smoothed C-rate")
    model.rhs[state] = (model.variables["C-rate"] - state) / 1200.0
    model.initial_conditions[state] = pybamm.Scalar(0)
    return -strength * state


def _drifting_reference(model: Any, strength: float) -> Any:
    """A voltage that creeps with the logarithm of time, whatever the cell does."""
    return strength * pybamm.log(1.0 + pybamm.t / 600.0)


def _ripple(model: Any, strength: float) -> Any:
    """A disturbance of the voltage with a period of forty minutes, as of a climate chamber."""
    return strength * pybamm.sin(2.0 * np.pi * pybamm.t / 2400.0)


OUTSIDE: Mapping[str, tuple[Callable[[Any, float], Any], float, float]] = {
    "soc-dependent-resistance": (_empty_resistance, 0.01, 0.15),
    "saturating-overpotential": (_rectifying_contact, 0.005, 0.06),
    "slow-memory": (_slow_memory, 0.005, 0.06),
    "drifting-reference": (_drifting_reference, 0.002, 0.015),
    "chamber-ripple": (_ripple, 0.003, 0.03),
}
"""Effects that no catalogue has, with the range of their strengths in V: the right verdict is `unexplained`."""
