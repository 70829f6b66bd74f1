"""Which parameters a model does not depend on: what is searched of them tells nothing, and costs simulations."""

from collections.abc import Mapping
from typing import Any

from ....core.target import DiffusivityShape, Factor, OcpShape, Target, Value
from ....core.task import CellModel
from ..cells.nameplate import CAPACITY
from ..cells.parameter_sets import CUT_OFFS, pybamm
from ..modelling.compiled_cell import CompiledCell, Start

_OUTSIDE = (CAPACITY, *CUT_OFFS.values())
"""Parameters that act outside the equations: on the currents of a protocol, and on what a state of charge means."""

_OUTPUTS = ("Voltage [V]", "Volume-averaged cell temperature [K]")

_AMBIENT_K = 303.0
"""No set's reference temperature, at which activation energies vanish from the equations, K."""

_ANSWERED: dict[str, frozenset[str]] = {}
"""Inputs of the models that were built to find them, by cell and targets: building one takes half a second, and a grid
asks the same of every task."""


def without_influence(cell: CellModel, targets: Mapping[str, Target]) -> list[str]:
    """Those of the targets, by name, on which neither the equations of a cell nor its voltage and temperature depend.

    The model is built with every target as an input, and asked which inputs it has.
    """
    inputs = {name: _input(name, target) for name, target in targets.items()}
    if not any(inputs.values()):
        return []
    question = repr((cell, sorted(targets.items())))
    if question not in _ANSWERED:
        built = CompiledCell(cell, targets, Start(temperature_k=_AMBIENT_K)).built_model()
        _ANSWERED[question] = frozenset(_inputs_in(built))
    present = _ANSWERED[question]
    return [name for name, own in inputs.items() if own and own not in present]


def _input(name: str, target: Target) -> str:
    """Name of the input that a target is in a built model; empty for what acts on the start or outside of it."""
    if isinstance(target, Value):
        return "" if target.name in _OUTSIDE else target.name
    return name if isinstance(target, Factor | OcpShape | DiffusivityShape) else ""


def _inputs_in(model: Any) -> set[str]:
    equations = (model.concatenated_rhs, model.concatenated_algebraic, model.concatenated_initial_conditions)
    outputs = (model.variables[name] for name in _OUTPUTS)
    symbols = [*equations, *outputs, *(event.expression for event in model.events)]
    found = pybamm.SymbolUnpacker(pybamm.InputParameter).unpack_list_of_symbols(symbols)
    return {parameter.name for parameter in found}
