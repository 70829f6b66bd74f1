"""How an effect enters a PyBaMM model: options, parameter values, the current, and terms of the terminal voltage."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from ...core.contracts.effect_choice import effects_of
from ...core.effect import Effect
from ...core.errors import BsaError
from ...core.task import CellModel

Symbols = Mapping[str, Any]
"""The effect's parameters by short name, as PyBaMM symbols or numbers."""


@dataclass(frozen=True)
class PyBaMMPart:
    """What an effect changes in a PyBaMM model. Every field is optional; all that are given apply.

    The functions must be importable (no lambdas), since models are also built in other processes, and should use
    nothing but `pybamm`, `np` and their arguments: ``augmented_model.py`` quotes their source. Of a
    `functools.partial` the arguments that it gives are numbers or text.
    """

    # Model options to add, ``{"contact resistance": "true"}``.
    options: Mapping[str, Any] = field(default_factory=dict)
    model: str = ""  # Model that replaces the base model; empty keeps it.
    # Parameter values that the equations need and many sets lack; used only where the set has none.
    borrowed: Mapping[str, Any] = field(default_factory=dict)
    # Mesh points of domains that the effect adds, ``{"R_n": 8}``.
    points: Mapping[str, int] = field(default_factory=dict)
    # ``values(known, p)`` returns parameters that replace those of the set; ``known[name]`` is the present value.
    values: Callable[[Mapping[str, Any], Symbols], Mapping[str, Any]] | None = None
    # ``voltage(model, p)`` returns an expression in V that is added to the terminal voltage, for example
    # ``-p["resistance"] * model.variables["Current [A]"]``. It may add a state to ``model.rhs`` and
    # ``model.initial_conditions``.
    voltage: Callable[[Any, Symbols], Any] | None = None
    # ``current(measured, p)`` returns the current through the electrodes (A, positive on discharge) from the measured
    # one.
    current: Callable[[Any, Symbols], Any] | None = None
    # ``at_rest(current, charge, capacity, p)`` returns what ``voltage`` adds to the open-circuit voltage along a
    # record, V, from the current (A) and the charge drawn since the start (A.h), both of shape (n,), and the cell's
    # nominal capacity (A.h).
    at_rest: Callable[[Any, Any, float, Mapping[str, float]], Any] | None = None


def part_of(effect: Effect) -> PyBaMMPart:
    """The PyBaMM part of an effect; an empty one for effects of the instrument alone.

    Raises `BsaError` if the effect was written for another simulator.
    """
    if effect.physics is None:
        return PyBaMMPart()
    if not isinstance(effect.physics, PyBaMMPart):
        raise BsaError(
            f'effect "{effect.key}" is not written for PyBaMM ({type(effect.physics).__name__}).',
            "give it a PyBaMMPart.",
        )
    return effect.physics


def effects_in(cell: CellModel) -> tuple[Effect, ...]:
    """The effects that a cell model has of its own.

    Raises `BsaError` if one does not exist, has variants of which none or more than one was named, or is one of the
    instrument.
    """
    if not cell.effects:
        return ()
    found = effects_of(cell.effects)
    for name in cell.effects:
        meant = [effect for effect in found if effect.is_called(name)]
        if len(meant) > 1:
            raise BsaError(
                f'effect "{name}" has variants: {", ".join(effect.key for effect in meant)}.', "name one of them."
            )
        if meant[0].measurement is not None:
            raise BsaError(
                f'effect "{name}" is one of the instrument, and a calibration simulates the cell alone.',
                "bsa discover --effect fits it.",
            )
    by_name: dict[str, str] = {}
    for effect in found:
        if effect.name in by_name:
            raise BsaError(
                f'"{by_name[effect.name]}" and "{effect.key}" are variants of one effect, whose parameters have the '
                "same names.",
                "name one of them.",
            )
        by_name[effect.name] = effect.key
    return tuple(effect.held_at(cell.strengths) for effect in found)


def refuse_current_effects(cell: CellModel) -> None:
    """Raise `BsaError` if a cell has an effect on the measured current: steps of a protocol have none."""
    for effect in effects_in(cell):
        if part_of(effect).current is not None:
            raise BsaError(
                f'effect "{effect.key}" acts on the measured current, and the steps of a protocol set their own.',
                "let the measured current drive the model: leave out the protocol.",
            )


def augmented_cell(cell: CellModel, effects: Sequence[Effect]) -> CellModel:
    """The cell model with the options of all effects. Raises `BsaError` if two of them ask for different things."""
    model, options = cell.model, dict(cell.options)
    asked: dict[str, str] = {}
    for effect in effects:
        part = part_of(effect)
        model = part.model or model
        for key, value in part.options.items():
            if key in asked and options[key] != value:
                raise BsaError(
                    f'{asked[key]} and {effect.key} want different values of the option "{key}".',
                    "they cannot be combined.",
                )
            options[key], asked[key] = value, effect.key
    return replace(cell, model=model, options=options)
