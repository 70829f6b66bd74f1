"""A cell model whose searched parameters are inputs: one compilation serves every candidate."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from ....core.effect import Effect
from ....core.errors import BsaError, unknown
from ....core.parameters import Candidate
from ....core.target import CellChange, CyclableLithium, InitialSoc, Target, Value, change_of, ocp_name
from ....core.task import CellModel, Experiment
from ....core.trajectory import FloatArray
from ..augmentation import PyBaMMPart, augmented_cell, effects_in, part_of
from ..cells.model_options import as_built
from ..cells.ocp_shape import ELECTRODES, OcpCurves, keeping_ocp_falling
from ..cells.parameter_sets import bake, input_values, load, open_to_search, pybamm, voltage_window
from ..cells.state_of_charge import InitialState, initial_concentration
from . import drive
from .fresh_integrator import FreshIntegrator
from .mesh import search_spatial_methods, submeshes
from .resolution import SEARCH, Resolution

MODELS = ("SPM", "SPMe", "DFN")

PAUSE = ("Pause begins [s]", "Pause ends [s]")
"""Inputs of a cell that is driven by a measured current: no current passes between these two times."""

OFFSET = "Current offset [A]"
"""Input of such a cell: what is added to its current."""

SOLVER_ERRORS = (pybamm.SolverError, ValueError, ArithmeticError, RuntimeError)
"""What a candidate can provoke in a solve."""


@dataclass(frozen=True)
class Start:
    """The state in which a simulation begins."""

    record: str = ""  # Name of the record that is simulated: its initial state of charge may be searched.
    soc: float | None = None  # State of charge, 0 to 1; None leaves it to the voltage.
    voltage: float | None = None  # Rest voltage, V; None keeps the parameter set's initial concentrations.
    temperature_k: float | None = None  # Ambient temperature, K; None keeps the parameter set's.
    initial_temperature_k: float | None = None  # Of the cell, K; None for the ambient one.

    def set_temperatures(self, values: Any) -> None:
        """Put its temperatures into a parameter set, in place; where none is known those of the set stay."""
        if self.temperature_k is not None:
            own = self.initial_temperature_k
            initial_k = self.temperature_k if own is None else own
            values.update({"Ambient temperature [K]": self.temperature_k, "Initial temperature [K]": initial_k})

    def soc_of(self, change: CellChange, soc_at: Callable[[float], float]) -> float | None:
        """The state of charge at which a changed cell starts; None keeps the set's initial concentrations.

        ``soc_at`` gives that at a voltage, see `InitialState.soc_at`.
        """
        start = self.moved(change)
        return soc_at(start.voltage) if start.soc is None and start.voltage is not None else start.soc

    def moved(self, change: CellChange) -> Start:
        """Where a changed cell starts: at the state of charge, or the corrected rest voltage, that the change says."""
        soc = change.soc_of(self.record)
        voltage = None if self.voltage is None else change.started_at(self.voltage)
        return replace(self, soc=self.soc if soc is None else soc, voltage=voltage)


def start_of(experiment: Experiment) -> Start:
    """Where an experiment begins."""
    return Start(
        experiment.name,
        experiment.initial_soc,
        experiment.initial_voltage,
        experiment.temperature_k,
        experiment.initial_temperature_k,
    )


def make_model(cell: CellModel) -> Any:
    """The PyBaMM model of a cell. Raises `BsaError` if the model or one of its options does not exist."""
    if cell.model not in MODELS:
        raise unknown(f'there is no model "{cell.model}".', cell.model, MODELS)
    options = as_built(cell.options)
    try:
        return getattr(pybamm.lithium_ion, cell.model)(options)
    except pybamm.OptionError as error:
        raise BsaError(
            f"PyBaMM refuses the model options {options}: {' '.join(str(error).split())}",
            "see pybamm's BatteryModelOptions.",
        ) from None


class CompiledCell:
    """A cell with or without effects, at a resolution; its parameters, start and mesh are ready to be simulated.

    ``targets`` are what is searched, by the names that candidates use, and ``effects`` what is added to the model
    beside the cell's own effects: the parameters of both become inputs. ``baked`` are values built into the model,
    which geometry on the standard mesh needs. ``measured_current`` drives the cell, with the voltage cut-offs widened;
    without it an experiment does. With ``any_start``, `inputs` may be asked for any state of charge.
    """

    def __init__(
        self,
        cell: CellModel,
        targets: Mapping[str, Target],
        start: Start,
        resolution: Resolution = SEARCH,
        baked: CellChange | None = None,
        effects: Sequence[Effect] = (),
        measured_current: drive.CurrentFunction | None = None,
        any_start: bool = False,
    ) -> None:
        baked = baked or CellChange()
        self._targets, self._effects, self._resolution = dict(targets), (*effects_in(cell), *effects), resolution
        self._known = baked.effects
        self._start = start.moved(baked)
        self._lithium = baked.cyclable_lithium
        augmented = augmented_cell(cell, self._effects)
        self._name = augmented.model
        self._model = make_model(augmented if measured_current is None else _with_averaged_reactions(augmented))
        self.heats = self._model.options["thermal"] != "isothermal"
        values = load(cell.parameter_set, cell.overrides)
        start.set_temperatures(values)
        bake(values, baked)
        self._feasible = keeping_ocp_falling(values, self._targets)
        starts = (InitialSoc(), InitialSoc(start.record), CyclableLithium())
        by_state = (
            any_start
            or self._start.soc is not None
            or start.voltage is not None
            or baked.cyclable_lithium != 1.0
            or any(target in starts for target in self._targets.values())
        )
        self._state = InitialState(values) if by_state else None
        self._without_effects = values.copy()
        open_to_search(values, self._targets)
        # Lower and upper voltage cut-off of the parameter set.
        self.window_v = voltage_window(values)
        self._add_effects(values, measured_current)
        if by_state:
            open_to_search(values, {name: Value(name) for name in map(initial_concentration, ELECTRODES)})
        self._values = values

    def _add_effects(self, values: Any, measured: drive.CurrentFunction | None) -> None:
        current: Any = None
        if measured is not None:
            values.update(drive.WIDE_CUT_OFFS)
            current = drive.interpolant(measured)
            current = current + pybamm.InputParameter(OFFSET) * pybamm.sign(current) ** 2
        for effect in self._effects:
            symbols = {p.name: pybamm.InputParameter(effect.full_name(p)) for p in effect.parameters}
            current = add_values(values, part_of(effect), symbols, current)
            add_voltage(self._model, part_of(effect), symbols)
        if measured is not None:
            values["Current function [A]"] = current * drive.gate(*PAUSE)

    def simulation(self, solver: Any, **how: Any) -> Any:
        """A PyBaMM simulation of the cell; ``how`` is handed on."""
        return pybamm.Simulation(
            self._model, parameter_values=self._values, solver=solver, **self._discretisation(), **how
        )

    def impedance(self) -> Any:
        """A PyBaMM simulation of the cell's impedance at rest; its model must have the double layers."""
        return pybamm.EISSimulation(self._model, parameter_values=self._values, **self._discretisation())

    def _discretisation(self) -> dict[str, Any]:
        standard = self._resolution.standard_mesh
        points = self._resolution.mesh()
        for effect in self._effects:
            points.update(part_of(effect).points)
        return {
            "submesh_types": submeshes(self._model, self._resolution),
            "spatial_methods": None if standard else search_spatial_methods(self._model),
            "var_pts": {**self._model.default_var_pts, **points} if points else None,
        }

    def built_model(self) -> Any:
        """The discretised model of a cell that is driven by its measured current.

        Raises `BsaError` if the model cannot be built, with or without its effects.
        """
        simulation = self.simulation(None)
        try:
            simulation.build()
        except (KeyError, pybamm.ModelError, pybamm.OptionError, pybamm.DomainError) as error:
            names = ", ".join(effect.key for effect in self._effects) or "no effect"
            raise BsaError(
                f"PyBaMM cannot build {self._name} with {names}: {first_line(error)}.",
                "the parameter set may lack what the effect needs.",
            ) from None
        return simulation.built_model

    def solver(self, options: Mapping[str, Any], resolution: Resolution | None = None, **how: Any) -> Any:
        """An integrator with the tolerances of a resolution, the cell's own if left out; ``how`` is handed on.

        It reports a failure to its caller, never on the screen.
        """
        resolution = resolution or self._resolution
        tolerances = {"rtol": resolution.rtol, "atol": resolution.atol}
        return FreshIntegrator(**tolerances, options={"silence_sundials_errors": True, **options}, **how)

    def inputs(self, candidate: Candidate, soc: float | None = None) -> dict[str, float]:
        """What PyBaMM's solve is given for a candidate.

        That has a value for every searched parameter and for the effects' parameters. Without a state of charge at the
        start the candidate says it, then the `Start`. Raises `ValueError` if the electrodes cannot start there.
        """
        change = self._feasible(change_of(self._targets, candidate))
        inputs = input_values(self._targets, candidate, change)
        strengths = {**self._known, **candidate}
        for effect in self._effects:
            own = effect.values(strengths)
            inputs.update({effect.full_name(p): own[p.name] for p in effect.parameters})
        if self._state is not None:
            change = replace(change, cyclable_lithium=self._lithium * change.cyclable_lithium)
            if soc is None:
                soc = self._start.soc_of(change, partial(self._soc_at, change, strengths))
            inputs |= self._state.concentrations(change, soc)
        return inputs

    def _soc_at(self, change: CellChange, strengths: Candidate, voltage: float) -> float:
        assert self._state is not None
        return self._state.soc_at(voltage, change, added_potentials(self._without_effects, self._effects, strengths))


def first_line(error: Exception) -> str:
    """What an error says, in a line."""
    lines = str(error).strip().splitlines()
    return lines[0][:200] if lines else type(error).__name__


def _with_averaged_reactions(cell: CellModel) -> CellModel:
    """The same with one SEI and one plated layer where an electrode is one particle: half as fast again, 0.1 mV off."""
    option = "x-average side reactions"
    if (
        cell.model not in ("SPM", "SPMe")
        or option in cell.options
        or not {"SEI", "lithium plating"} & set(cell.options)
    ):
        return cell
    return replace(cell, options={**cell.options, option: "true"})


def add_values(values: Any, part: PyBaMMPart, p: Mapping[str, Any], current: Any) -> Any:
    """Put an effect's parameter values into a set, in place, and return the current it makes of the given one.

    None stays None: an impedance is that of a cell at rest.
    """
    for name, value in part.borrowed.items():
        if name not in values:
            values.update({name: value}, check_already_exists=False)
    if part.values is not None:
        values.update(dict(part.values(values, p)), check_already_exists=False)
    return part.current(current, p) if part.current is not None and current is not None else current


def added_potentials(values: Any, effects: Sequence[Effect], candidate: Candidate) -> dict[str, FloatArray]:
    """What effects add to the open-circuit potential of an electrode of a parameter set, V, on `GRID`.

    Electrodes whose potential they leave alone are left out.
    """
    changed = values.copy()
    for effect in effects:
        add_values(changed, part_of(effect), effect.values(candidate), None)
    others = [which for which in ELECTRODES if changed[ocp_name(which)] is not values[ocp_name(which)]]
    if not others:
        return {}
    before, after = OcpCurves(values), OcpCurves(changed)
    return {which: after.curve(which, CellChange()) - before.curve(which, CellChange()) for which in others}


def add_voltage(model: Any, part: PyBaMMPart, p: Mapping[str, Any]) -> None:
    """Add an effect's term to the terminal voltage of a model, in place.

    A hold is controlled by the one variable, and a step that ends at a voltage by the other: both are what an
    instrument shows.
    """
    if part.voltage is not None:
        added = part.voltage(model, p)
        cells = pybamm.Parameter("Number of cells connected in series to make a battery")
        model.variables["Voltage [V]"] = model.variables["Voltage [V]"] + added
        model.variables["Battery voltage [V]"] = model.variables["Battery voltage [V]"] + added * cells
