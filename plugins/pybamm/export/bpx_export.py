"""A calibrated cell as a BPX file, and what of it BPX cannot say.

Battery Parameter eXchange, version 1.1, https://bpxstandard.com; PyBaMM reads it in ``pybamm.parameters.bpx``.
"""

import json
import warnings
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....core.errors import BsaError
from ....core.extras import require
from ....core.printable import shown
from ....core.target import CellChange
from ....core.task import CellModel, Experiment
from ....core.trajectory import FloatArray
from ..cells.nameplate import CAPACITY, labelled
from ..cells.ocp_shape import ELECTRODES, GRID
from ..cells.parameter_sets import CUT_OFFS, arguments_of, bake, load, pybamm
from ..cells.state_of_charge import InitialState, initial_concentration, maximum_concentration
from ..modelling.compiled_cell import Start, start_of

VERSION = "1.1.0"

_FARADAY, _GAS_CONSTANT = 96485.33212, 8.314462618
_AT_REST = tuple(CUT_OFFS.values())

_STOICHIOMETRIES: FloatArray = np.unique(np.concatenate([np.linspace(0.0, 1.0, 1001), GRID[::5]]).clip(1e-6, 1 - 1e-6))
"""Where functions of stoichiometry are tabulated: straight lines between stay within 0.1 mV of the usual potentials."""

_CONCENTRATIONS: FloatArray = np.linspace(1.0, 4000.0, 400)
"""Where functions of the electrolyte's concentration are tabulated, mol/m3: from depleted to what salts dissolve."""

_WARMER_K = 10.0
"""Over which activation energies are taken from the set's functions, K."""

_TEMPERATURE = ("T", "temperature")
"""Names of the argument that is a temperature: PyBaMM's, and that of parameter files which older runs wrote."""

_SAME = 1e-2
"""Relative deviation beyond which a function does not have the form that BPX prescribes."""

_OPEN = 1.0 - 1e-9
"""Largest porosity: readers take a Bruggeman coefficient from its logarithm, which is none where nothing is solid."""

_BEYOND = 5e-4
"""How far beyond 0 and 1 a state of charge is mentioned: what is seen of it in percent with one digit."""

_OUTSIDE = ("thermal", "contact resistance", "calculate discharge energy")
"""Model options that need no mention: they belong to a run, or are kept in the user-defined section."""


@dataclass(frozen=True)
class BpxExport:
    """A BPX file."""

    content: Mapping[str, Any]  # The file.
    left_out: tuple[str, ...]  # What of the cell it cannot say, or where not every program reads it, each a sentence.

    @property
    def text(self) -> str:
        """The file as JSON."""
        return json.dumps(self.content, indent=1)


def to_bpx(cell: CellModel, change: CellChange, experiment: Experiment, title: str) -> BpxExport:
    """A changed cell as BPX, checked by the ``bpx`` package.

    Functions are tabulated at the temperature of the experiment, which becomes the reference temperature; the
    experiment gives the state of charge at the start too. The title is untrusted. Raises `BsaError` if ``bpx`` is not
    installed, or the cell is not of the kind that BPX describes.
    """
    bpx = require("bpx", "bpx", "a BPX file")
    values = load(cell.parameter_set, cell.overrides)
    bake(values, change)
    labelled(values, cell)
    start = start_of(experiment)
    start.set_temperatures(values)
    writer = _Writer(values, change.cyclable_lithium, {*cell.overrides, *change.values, *change.factors})
    content = writer.written(cell, start.moved(change))
    content["Header"]["Title"] = title
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            bpx.parse_bpx_obj(json.loads(json.dumps(content)))  # it changes what it is given
        except ValueError as error:
            raise BsaError(
                f"bpx refuses the file: {' '.join(str(error).split())[:300]}.", "export the parameter values instead."
            ) from None
    return BpxExport(content, tuple(writer.left_out))


class _Writer:
    """Writes one cell.

    ``lithium`` is what the lithium that both electrodes share is multiplied by, ``changed`` the names of the values
    that are not the set's own.
    """

    def __init__(self, values: Any, lithium: float, changed: Collection[str]) -> None:
        self._values, self._lithium, self._changed = values, lithium, changed
        self._read = {*map(initial_concentration, ELECTRODES), *_AT_REST}  # names of what the file is made of
        self._kelvin = self._number("Ambient temperature [K]")
        self._salt = self._number("Initial concentration in electrolyte [mol.m-3]")
        self.left_out: list[str] = []  # What the file cannot say.

    def written(self, cell: CellModel, start: Start) -> dict[str, Any]:
        """The file; a cell starts at a state of charge, else at an open-circuit voltage (V), else as its set does."""
        state = InitialState(self._values)
        lithium = CellChange(cyclable_lithium=self._lithium)
        empty, full = (state.concentrations(lithium, at) for at in (0.0, 1.0))
        soc = start.soc_of(CellChange(), lambda voltage: state.soc_at(voltage, lithium))
        if soc is None:
            name = initial_concentration("Negative")
            own = state.concentrations(lithium, None)[name]
            soc = (own - empty[name]) / (full[name] - empty[name])
        electrodes = {side: self._electrode(side, empty, full) for side in ELECTRODES}
        parts = {
            "Cell": self._cell(),
            "Electrolyte": self._electrolyte(),
            **{f"{side} electrode": electrode for side, electrode in electrodes.items()},
            "Separator": self._layer("Separator"),
            "User-defined": {
                "Contact resistance [Ohm]": self._number("Contact resistance [Ohm]"),
                # What the file's own potentials show at the limits of its stoichiometries, at its own temperature.
                _AT_REST[0]: _voltage(electrodes, "Minimum", "Maximum"),
                _AT_REST[1]: _voltage(electrodes, "Maximum", "Minimum"),
            },
        }
        surroundings = {
            "Ambient temperature [K]": self._kelvin,
            "Heat transfer coefficient [W.m-2.K-1]": self._number("Total heat transfer coefficient [W.m-2.K-1]"),
        }
        beyond = [f"{name}={value}" for name, value in cell.options.items() if name not in _OUTSIDE and value != "none"]
        if cell.effects:
            self.left_out.append(f"BPX has no effects beside its equations; the fit had {', '.join(cell.effects)}.")
        if beyond:
            self.left_out.append(f"BPX has no model options; the fit used {', '.join(beyond)}.")
        self._mention_heat(cell.options.get("thermal", "isothermal"))
        if self._number("Number of cells connected in series to make a battery") != 1:
            self.left_out.append("BPX describes a single cell; cells in series are not in the file.")
        if cell.model not in ("DFN", "SPMe"):
            self.left_out.append(
                f"the cell was fitted with {cell.model}; the file has the parameters of a DFN, whose voltage differs."
            )
        initial = {
            "Initial state-of-charge": self._within_limits(soc),
            "Initial temperature [K]": self._number("Initial temperature [K]"),
            "Initial electrolyte concentration [mol.m-3]": self._salt,
        }
        parts["User-defined"].update(self._without_a_field())  # when all else has been read
        return {
            "Header": {"BPX": VERSION, "Title": "", "Model": "SPMe" if cell.model == "SPMe" else "DFN"},
            "Parameterisation": parts,
            "State": {"Initial conditions": initial, "Thermal environment": surroundings},
        }

    def _own(self, name: str) -> Any:
        self._read.add(name)
        return self._values[name]

    def _number(self, name: str) -> float:
        return float(self._values.evaluate(self._own(name)))

    def _evaluated(self, symbol: Any) -> FloatArray:
        """An expression of parameters in numbers, shape (n,)."""
        parameters = (pybamm.Parameter, pybamm.FunctionParameter)
        self._read |= {node.name for node in symbol.pre_order() if isinstance(node, parameters)}
        return np.asarray(self._values.process_symbol(symbol).evaluate(), dtype=np.float64).ravel()

    def _without_a_field(self) -> dict[str, float]:
        """Changed numbers that BPX has no field for, by PyBaMM's names; they and changed functions are mentioned."""
        lacking = sorted(name for name in self._changed if name not in self._read)
        numbers = {name: self._number(name) for name in lacking if not callable(self._values[name])}
        for name in lacking:
            kept = "in the user-defined section, which not every program reads"
            where = kept if name in numbers else "not in the file"
            self.left_out.append(f'BPX has no field for "{shown(name, 120)}": it is {where}.')
        return numbers

    def _within_limits(self, soc: float) -> float:
        """The state of charge at the start, from 0 to 1 as BPX has it; a clear change is mentioned."""
        kept = float(np.clip(soc, 0.0, 1.0))
        if abs(soc - kept) > _BEYOND:
            self.left_out.append(
                f"The record starts at a state of charge of {100 * soc:.1f} %; BPX has 0 to 100 %, and the file starts "
                f"at {100 * kept:.0f} %."
            )
        return kept

    def _mention_heat(self, thermal: str) -> None:
        """Say what of the heat balance of a thermal model is otherwise in the file."""
        if thermal not in ("isothermal", "lumped"):
            self.left_out.append(
                "Heat capacities and conductivities of the layers are not in the file: BPX has one heat capacity for "
                "the cell."
            )
        if thermal == "isothermal":
            return
        cold, warm = (self._heat_capacity(kelvin) for kelvin in (self._kelvin, self._kelvin + _WARMER_K))
        if abs(warm / cold - 1.0) > _SAME:
            self.left_out.append(
                f"The heat capacity is a number in BPX: that at {self._kelvin:g} K; {_WARMER_K:g} K above, the "
                f"cell's own is {100 * abs(warm / cold - 1.0):.2g} % {'larger' if warm > cold else 'smaller'}."
            )

    def _heat_capacity(self, kelvin: float) -> float:
        """Effective heat capacity of the layers and the current collectors, J/(m3 K)."""
        return float(self._evaluated(pybamm.thermal_parameters.rho_c_p_eff(pybamm.Scalar(kelvin)))[0])

    def _density(self) -> float:
        """Effective density of the layers and the current collectors, kg/m3."""
        of, thickness, kelvin = pybamm.thermal_parameters, pybamm.geometric_parameters, pybamm.Scalar(self._kelvin)
        layers = sum(getattr(of, side).rho(kelvin) * getattr(thickness, side).L for side in ("n", "s", "p"))
        collectors = sum(getattr(of, side).rho_cc(kelvin) * getattr(thickness, side).L_cc for side in ("n", "p"))
        return float(self._evaluated((layers + collectors) / thickness.L)[0])

    def _cell(self) -> dict[str, Any]:
        pairs = self._number("Number of electrodes connected in parallel to make a cell")
        area = self._number("Electrode width [m]") * self._number("Electrode height [m]")
        density = self._density()
        return {
            "Electrode area [m2]": area * pairs / max(round(pairs), 1),
            "Number of electrode pairs connected in parallel to make a cell": max(round(pairs), 1),
            "External surface area [m2]": self._number("Cell cooling surface area [m2]"),
            "Volume [m3]": self._number("Cell volume [m3]"),
            "Density [kg.m-3]": density,
            "Specific heat capacity [J.K-1.kg-1]": self._heat_capacity(self._kelvin) / density,
            **{name: self._number(name) for name in (*CUT_OFFS, CAPACITY)},
            "Reference temperature [K]": self._kelvin,
        }

    def _electrolyte(self) -> dict[str, Any]:
        names = ("Electrolyte conductivity [S.m-1]", "Electrolyte diffusivity [m2.s-1]")
        conductivity, diffusivity = (self._table(name, _CONCENTRATIONS) for name in names)
        transference = self._constant("Cation transference number")
        factor = self._constant("Thermodynamic factor")
        if abs(factor - 1.0) > _SAME:
            # Voltages of small salt gradients go with (1 - t)^2 and with the factor.
            transference = 1.0 - (1.0 - transference) * factor**0.5
            self.left_out.append(
                f"BPX has no thermodynamic factor ({factor:.4g} at the initial concentration): a cation transference "
                f"number of {transference:.4g} gives small salt gradients the same voltage."
            )
        return {
            "Cation transference number": transference,
            "Conductivity [S.m-1]": conductivity,
            "Conductivity activation energy [J.mol-1]": self._energy(names[0], self._salt),
            "Diffusivity [m2.s-1]": diffusivity,
            "Diffusivity activation energy [J.mol-1]": self._energy(names[1], self._salt),
        }

    def _constant(self, name: str) -> float:
        """A property of the electrolyte at the initial concentration; that it has a course is left out."""
        course = self._course(name, _CONCENTRATIONS)
        at_start = float(self._course(name, np.array([self._salt]))[0])
        if np.ptp(course) > _SAME * abs(at_start):
            self.left_out.append(f"{name} is a number in BPX: {at_start:.4g} in place of the set's own course.")
        return at_start

    def _layer(self, name: str) -> dict[str, float]:
        porosity = min(self._number(f"{name} porosity"), _OPEN)
        bruggeman = self._number(f"{name} Bruggeman coefficient (electrolyte)")
        return {
            "Thickness [m]": self._number(f"{name} thickness [m]"),
            "Porosity": porosity,
            "Transport efficiency": porosity**bruggeman,
        }

    def _electrode(self, side: str, empty: Mapping[str, float], full: Mapping[str, float]) -> dict[str, Any]:
        layer = self._layer(f"{side} electrode")
        highest = self._number(maximum_concentration(side))
        limits = sorted(state[initial_concentration(side)] / highest for state in (empty, full))
        radius = self._number(f"{side} particle radius [m]")
        entropic = self._course(f"{side} electrode OCP entropic change [V.K-1]", _STOICHIOMETRIES)
        warmer = self._kelvin - self._number("Reference temperature [K]")
        potential = self._course(f"{side} electrode OCP [V]", _STOICHIOMETRIES) + warmer * entropic
        solid = (1.0 - layer["Porosity"]) ** self._number(f"{side} electrode Bruggeman coefficient (electrode)")
        return {
            **layer,
            "Conductivity [S.m-1]": solid
            * float(self._course(f"{side} electrode conductivity [S.m-1]", np.ones(1))[0]),
            "Minimum stoichiometry": limits[0],
            "Maximum stoichiometry": limits[1],
            "Maximum concentration [mol.m-3]": highest,
            "Particle radius [m]": radius,
            "Surface area per unit volume [m-1]": (
                3.0 * self._number(f"{side} electrode active material volume fraction") / radius
            ),
            "Diffusivity [m2.s-1]": self._table(f"{side} particle diffusivity [m2.s-1]", _STOICHIOMETRIES),
            "Diffusivity activation energy [J.mol-1]": self._energy(f"{side} particle diffusivity [m2.s-1]", 0.5),
            "OCP [V]": _as_table(_STOICHIOMETRIES, potential),
            "Entropic change coefficient [V.K-1]": _as_table(_STOICHIOMETRIES, entropic),
            "Reaction rate constant [mol.m-2.s-1]": self._rate_constant(side, highest),
            "Reaction rate constant activation energy [J.mol-1]": self._reaction_energy(side, highest),
        }

    def _reaction_energy(self, side: str, highest: float) -> float:
        function = self._own(f"{side} electrode exchange-current density [A.m-2]")
        return self._arrhenius(lambda kelvin: self._at(function, self._salt, 0.5 * highest, highest, kelvin=kelvin))

    def _rate_constant(self, side: str, highest: float) -> float:
        """The k of BPX's j0 = F k sqrt(c_e / c_e0) sqrt(x (1 - x)); a word is said where the set's j0 is another."""
        function: Callable[..., Any] = self._own(f"{side} electrode exchange-current density [A.m-2]")
        share = np.linspace(0.1, 0.9, 17)
        salt = np.array([0.5, 1.0, 1.5])[:, None] * self._salt
        found = np.array(
            [[self._at(function, float(c_e), float(x) * highest, highest) for x in share] for c_e in salt.ravel()]
        )
        form = _FARADAY * np.sqrt(salt / self._salt) * np.sqrt(share * (1.0 - share))
        rate = float(found[1, len(share) // 2] / form[1, len(share) // 2])
        off = float(np.max(np.abs(found / (rate * form) - 1.0)))
        if off > _SAME:
            self.left_out.append(
                f"The exchange-current density of the {side.lower()} electrode has not the form that BPX prescribes: "
                f"met at half lithiation, it is up to {100 * off:.0f} % off elsewhere."
            )
        return rate

    def _at(self, function: Any, *arguments: float, kelvin: float | None = None) -> float:
        if not callable(function):
            return float(function)
        symbols = [pybamm.Scalar(value) for value in (*arguments, self._kelvin if kelvin is None else kelvin)]
        return float(self._evaluated(pybamm.convert_to_symbol(function(*symbols)))[0])

    def _energy(self, name: str, at: float) -> float:
        """Activation energy of a diffusivity or conductivity around the reference temperature, J/mol."""
        return self._arrhenius(lambda kelvin: float(self._course(name, np.array([at]), kelvin)[0]))

    def _arrhenius(self, rate: Callable[[float], float]) -> float:
        warm = self._kelvin + _WARMER_K
        return _GAS_CONSTANT * float(np.log(rate(warm) / rate(self._kelvin))) / (1.0 / self._kelvin - 1.0 / warm)

    def _course(self, name: str, at: FloatArray, kelvin: float | None = None) -> FloatArray:
        """A number, or a function of one variable (and of temperature), on a grid."""
        value = self._own(name)
        if not callable(value):
            return np.full_like(at, float(self._values.evaluate(value)))
        temperature = pybamm.Scalar(self._kelvin if kelvin is None else kelvin)
        symbol = value(*(temperature if name in _TEMPERATURE else pybamm.Vector(at) for name in arguments_of(value)))
        return np.broadcast_to(self._evaluated(pybamm.convert_to_symbol(symbol)), at.shape).copy()

    def _table(self, name: str, at: FloatArray) -> Any:
        found = self._course(name, at)
        return float(found[0]) if np.ptp(found) <= 1e-12 * abs(found[0]) else _as_table(at, found)


def _voltage(electrodes: Mapping[str, Mapping[str, Any]], negative: str, positive: str) -> float:
    """Open-circuit voltage of electrodes of BPX at these of their stoichiometries, ``Minimum`` or ``Maximum``, V."""
    potentials = [
        np.interp(electrodes[side][f"{limit} stoichiometry"], *electrodes[side]["OCP [V]"].values())
        for side, limit in zip(ELECTRODES, (negative, positive), strict=True)
    ]
    return float(potentials[1] - potentials[0])


def _as_table(x: FloatArray, y: FloatArray) -> dict[str, list[float]]:
    return {"x": x.tolist(), "y": y.tolist()}
