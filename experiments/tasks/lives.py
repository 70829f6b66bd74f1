"""A cycler's record of a whole life as what is fitted of it, and what is forecast."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...core.ageing.choice import kept_cycles
from ...core.ageing.cycle_table import CycleTable
from ...core.ageing.long_record import measured_table, with_curves
from ...core.ageing.typical_cycle import TypicalCycle, typical_cycle, without_cut_short
from ...core.errors import BsaError
from ...core.record import Record
from ...core.segmentation.recognised_protocol import with_switches
from ...core.trajectory import Trajectory

if TYPE_CHECKING:
    from .record_request import RecordRequest

_FEWEST = 3
"""Cycles without which there is no life to speak of."""

_AGEING_OPTIONS = ("SEI", "lithium plating", "loss of active material", "particle mechanics")

USUAL_GROWTH = {"SEI": "solvent-diffusion limited", "SEI film resistance": "distributed"}
"""The first mechanism to try where none is named: capacity falls with the square root of time, as that of most cells
does for most of their life."""


def with_ageing(options: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """Model options under which a cell ages, and a sentence where they had to be chosen.

    Any option given, also ``SEI=none``, is kept.
    """
    if any(name in options for name in _AGEING_OPTIONS):
        return dict(options), ""
    return {**options, **USUAL_GROWTH}, (
        f"No mechanism of ageing was named: the model has an SEI that is {USUAL_GROWTH['SEI']} "
        '(--options SEI="...", --options "lithium plating=..." and others choose).'
    )


def cracks_note(model: str, options: Mapping[str, Any]) -> list[str]:
    """What is to be said of SEI on cracks where the model does not lose the lithium that it binds."""
    if model == "DFN" or "true" not in str(options.get("SEI on cracks", "false")):
        return []
    return [
        f"PyBaMM's {model} takes no lithium from the particles for the SEI on cracks: capacity does not fall by it. "
        "--model DFN takes it."
    ]


def as_life(request: RecordRequest, record: Record) -> list[RecordRequest]:
    """The request for what is fitted and, where later cycles are to be forecast, the one for those.

    Every cycle is simulated as the record's most frequent one. Cycles of other steps, and those that were cut short,
    are not compared.

    Raises `BsaError` if too few cycles are alike, or none is left to be fitted.
    """
    whole = record.trajectory
    cycle = typical_cycle(with_switches(whole), record.name)
    table = without_cut_short(measured_table(whole, cycle.numbers))
    if len(table) < _FEWEST:
        raise BsaError(
            f"{record.name} has {len(whole.cycles)} cycles, of which {len(table)} are alike and whole.",
            "a life needs more; leave out --life, or write a task file with its protocol (docs/ageing.md).",
        )
    last = request.fit_cycles or whole.cycles[-1]
    fitted, later = table.up_to(last), table.cycle > last
    if fitted is None:
        raise BsaError(f"{record.name} has no whole cycle up to {last}.", "fit more cycles.")
    found = [_part(request, record, cycle, fitted, (*record.notes, _told(whole, table, cycle)))]
    return [*found, _part(request, record, cycle, table.lines(later), ())] if later.any() else found


def _told(whole: Trajectory, table: CycleTable, cycle: TypicalCycle) -> str:
    words = f"every cycle is simulated as: {', '.join(cycle.steps)}"
    left_out = len(whole.cycles) - len(table)
    if left_out:
        words += f"; {left_out} of {len(whole.cycles)} cycles were cut short or have other steps, and are not compared"
    return f"{words}."


def _part(
    request: RecordRequest, record: Record, cycle: TypicalCycle, table: CycleTable, notes: tuple[str, ...]
) -> RecordRequest:
    first, last = int(table.cycle[0]), int(table.cycle[-1])
    wanted = request.detailed_cycles
    if wanted is None or wanted == "auto":
        kept = kept_cycles(last, table)
    else:
        kept = tuple(sorted({number for number in wanted if first <= number <= last}))
    part = Record(
        f"{record.name}, cycles {first} to {last}",
        with_curves(record.trajectory, table, kept or (first, last)),
        notes,
        record.ambient_k,
    )
    protocol = (cycle.steps,) * last
    return replace(request, source=part, shown_protocol=protocol, detailed_cycles=kept, whole_name=record.name)
