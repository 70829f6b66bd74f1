"""What a cell is labelled with, for those who use it: nominal capacity and voltage cut-offs."""

from collections.abc import Mapping
from typing import Any

from ....core.task import CellModel, ParameterSource
from .parameter_sets import CUT_OFFS, load

CAPACITY = "Nominal cell capacity [A.h]"

_WIDTH = "Electrode width [m]"


def nominal_capacity_ah(parameter_set: ParameterSource, overrides: Mapping[str, float]) -> float:
    """Nominal capacity of a cell, A.h: the set's, in proportion to the electrode area where an override changes it."""
    own = load(parameter_set)
    if CAPACITY in overrides:
        return overrides[CAPACITY]
    return float(own[CAPACITY]) * overrides.get(_WIDTH, float(own[_WIDTH])) / float(own[_WIDTH])


def widened_cut_offs(cell: CellModel) -> dict[str, float]:
    """The voltage cut-offs that a calibration widened so that a protocol's own steps end a cycle, V; empty without.

    What the set's own ones mean for the state of charge is then overridden too.
    """
    given = cell.overrides
    return {name: given[name] for name, at_rest in CUT_OFFS.items() if name in given and at_rest in given}


def labelled(values: Any, cell: CellModel) -> Any:
    """The values of a cell with its own cut-offs, and the nominal capacity of its size, in place; returns them."""
    own = load(cell.parameter_set)
    values.update({CAPACITY: nominal_capacity_ah(cell.parameter_set, cell.overrides)})
    values.update({name: own[name] for name in widened_cut_offs(cell)})
    return values
