"""The cell that is to match the records, and what of it is searched."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...core.parameters import ParameterSpace
from ...core.record import Record
from ...core.task import CellModel, ParameterFile, ParameterSource
from .cell_for_records import (
    WIDTH,
    at_several_temperatures,
    cooling_note,
    hysteresis_note,
    measured_thermodynamic_factor,
    temperature_dependent,
    volume_and_surface,
    wide_window,
    with_chosen_potentials,
    with_searched_energies,
    with_thermal_model,
)
from .cell_size import size_factor, starting_soc
from .influence import simulated_models, with_influence
from .lives import cracks_note, with_ageing
from .record_request import RECOGNISED, RecordRequest
from .record_start import jump_resistances
from .spectra import ohmic_resistances

CONTACT, RESISTANCE = "contact resistance", "Contact resistance [Ohm]"
"""PyBaMM's option for a series resistance, and its parameter."""

_CORRECTION = "Negative electrode OCP correction at stoichiometry 0.5 [V]"
"""One of the parameters by which a preset searches the shape of open-circuit potentials."""

_CONTACT_SHARE = 0.6
"""Share of the voltage jump at a current step that is put down to the contacts, to start with."""


@dataclass(frozen=True)
class CellRequest:
    """What a person says of the cell."""

    # parameter_set, model, options, overrides, effects, strengths: As in `CellModel`. The set may be ``"nearest"``:
    # that of the positive electrode among the nearest potentials. The parameters of the effects are searched too, but
    # for those whose strengths are given.
    parameter_set: ParameterSource
    model: str = "DFN"
    options: Mapping[str, Any] = field(default_factory=dict)
    overrides: Mapping[str, float] = field(default_factory=dict)
    search: str | Mapping[str, Any] = "cell"  # Name of a preset, or parameters with bounds.
    # Whether the electrode area is scaled when the cell is of another size than the parameter set's.
    scale_to_capacity: bool = True
    # Whose open-circuit potentials the cell starts with: ``"nearest"``, a set, or two with a slash between them (see
    # `chosen_potentials`); empty keeps those of the parameter set.
    ocp: str = ""
    effects: Sequence[str] = ()
    strengths: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def given(self) -> frozenset[str]:
        """Parameters whose value, or start, the person has written: nothing may replace these."""
        from ...plugins.pybamm.before_search.presets import starts_given

        return frozenset(starts_given(self.search) | set(self.overrides))

    @property
    def is_own_file(self) -> bool:
        """Whether the parameter set is a file of the person's."""
        return isinstance(self.parameter_set, ParameterFile)


@dataclass(frozen=True)
class MeasuredCell:
    """The cell where the search starts, and how it was found."""

    model: CellModel
    capacity_ah: float  # Between its own cut-offs, at equilibrium.
    notes: list[str]


def measured_cell(
    wanted: CellRequest,
    requests: Sequence[RecordRequest],
    records: Sequence[Record],
    held_out: Sequence[Record] = (),
) -> MeasuredCell:
    """The cell model for records: potentials, temperature, electrolyte, size and options.

    ``records`` are those of the ``requests``.
    """
    parameter_set, options, notes = _set_and_options(wanted, requests, records, held_out)
    model = CellModel(parameter_set, wanted.model, options, wanted.overrides, tuple(wanted.effects), wanted.strengths)
    overrides, capacity_ah, said = _values(wanted, model, requests, records)
    return MeasuredCell(replace(model, overrides=overrides), capacity_ah, [*notes, *said])


def _set_and_options(
    wanted: CellRequest,
    requests: Sequence[RecordRequest],
    records: Sequence[Record],
    held_out: Sequence[Record],
) -> tuple[ParameterSource, dict[str, Any], list[str]]:
    from ...plugins.pybamm.before_search.presets import searches
    from ...plugins.pybamm.cells.model_options import in_pybamm_spelling
    from ...plugins.pybamm.cells.parameter_sets import load

    corrected = not wanted.is_own_file and searches(wanted.search, _CORRECTION)
    parameter_set, notes = with_chosen_potentials(wanted.parameter_set, wanted.ocp, records, corrected)
    notes = notes if wanted.effects else [*notes, *hysteresis_note(records)]
    values = load(parameter_set, wanted.overrides)
    options, said = with_thermal_model(
        in_pybamm_spelling(wanted.options), requests, records, held_out, parameter_set, values
    )
    notes += [*said, *cooling_note(parameter_set, options, wanted.given, values)]
    if at_several_temperatures(options, [*records, *held_out]) and not wanted.is_own_file:
        parameter_set, said = temperature_dependent(
            CellModel(parameter_set, wanted.model, options, wanted.overrides), wanted.search
        )
        notes += said
        parameter_set, said = with_searched_energies(parameter_set, wanted.search, wanted.overrides, records)
        notes += said
    if any(request.is_life for request in requests):
        options, note = with_ageing(options)
        notes += [note] * bool(note)
    notes += cracks_note(wanted.model, options)
    if CONTACT not in options and all(request.as_measured for request in requests):
        # Tabs, leads and clamps are in every record, and in no parameter set.
        options[CONTACT] = "true"
    return parameter_set, options, notes


def _values(
    wanted: CellRequest, model: CellModel, requests: Sequence[RecordRequest], records: Sequence[Record]
) -> tuple[dict[str, float], float, list[str]]:
    """What replaces numbers of the model's parameter set, the capacity in A.h, and what is to be said of them."""
    from ...plugins.pybamm.cells.nameplate import CAPACITY, nominal_capacity_ah
    from ...plugins.pybamm.cells.parameter_sets import load
    from ...plugins.pybamm.cells.state_of_charge import equilibrium_capacity_ah

    values = load(model.parameter_set, wanted.overrides)
    capacity_ah = equilibrium_capacity_ah(model.parameter_set, wanted.overrides)
    replaced: dict[str, float] = {}
    notes: list[str] = []
    if not wanted.is_own_file:
        replaced, notes = measured_thermodynamic_factor(model, values, wanted.search, wanted.given)
    in_amperes = all(request.as_measured for request in requests)
    scaled = wanted.scale_to_capacity and in_amperes and WIDTH not in wanted.given
    factor, note = 1.0, ""
    if scaled:
        starts = [starting_soc(model, *one) for one in zip(requests, records, strict=True)]
        factor, note = size_factor(records, values, capacity_ah, starts)
    if note:
        sizes, said = volume_and_surface(values, factor)
        replaced |= {WIDTH: float(values[WIDTH]) * factor, **sizes}
        notes += [note, *said]
    if any(request.protocol == RECOGNISED for request in requests):
        replaced |= wide_window(values, records)
    kept = {name: value for name, value in replaced.items() if name not in wanted.given}
    overrides = {**wanted.overrides, **kept}
    if in_amperes and WIDTH in overrides:
        # What counts in the cell's own capacity (C-rates, an effect's charge) is that of its size.
        overrides.setdefault(CAPACITY, nominal_capacity_ah(model.parameter_set, overrides))
    return overrides, capacity_ah * factor, notes


def searched_space(
    wanted: CellRequest, cell: CellModel, records: Sequence[Record], spectra: Sequence[RecordRequest]
) -> tuple[ParameterSpace, list[str]]:
    """What of the cell is searched (what the person asks for, and the parameters of the effects), and what is said.

    Raises `BsaError` if the person names a parameter that has no influence on the model.
    """
    from ...plugins.pybamm.augmentation import augmented_cell, effects_in
    from ...plugins.pybamm.before_search.presets import is_preset, resolve_space

    effects = effects_in(cell)
    augmented_cell(cell, effects)  # two may ask for different things
    models = simulated_models(cell, bool(records), bool(spectra))
    space = resolve_space(cell.parameter_set, wanted.search, cell.overrides, models[-1].options)
    by_preset = is_preset(wanted.search)
    if by_preset:
        # A preset does not know what this person knows.
        space = ParameterSpace(tuple(parameter for parameter in space if parameter.name not in wanted.overrides))
    space, notes = with_influence(space, models, f'the preset "{wanted.search}"' * by_preset)
    of_effects = [p for effect in effects for p in effect.searched if p.name not in cell.strengths]
    space = ParameterSpace((*space, *of_effects))
    return _with_resistance_started(space, wanted, cell, records, spectra), notes


def _with_resistance_started(
    space: ParameterSpace,
    wanted: CellRequest,
    cell: CellModel,
    records: Sequence[Record],
    spectra: Sequence[RecordRequest],
) -> ParameterSpace:
    """The space with a contact resistance that starts where the records show it."""
    from ...plugins.pybamm.cells.parameter_sets import load

    values = load(cell.parameter_set, cell.overrides)
    if RESISTANCE in wanted.given or values.get(RESISTANCE, 0.0) or RESISTANCE not in space:
        return space
    if wanted.is_own_file:  # a whole cell, whose resistances are in the file
        return space.started({RESISTANCE: space[RESISTANCE].project(0.0)})
    jumps = list(ohmic_resistances(spectra)) or [ohm for one in records for ohm in jump_resistances(one.trajectory)]
    if not jumps:
        return space
    return space.started({RESISTANCE: space[RESISTANCE].project(_CONTACT_SHARE * float(np.median(jumps)))})
