"""A record to be matched: its file, and what its file does not say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from ...core.errors import BsaError
from ...core.reading.parts import parts_between_gaps
from ...core.record import Record
from ...core.segmentation.recognised_protocol import recognised_protocol
from ...core.spectrum import ImpedanceSpectrum
from ...core.task import Protocol
from ..file_reading import FileReading
from .lives import as_life
from .record_start import open_circuit_start

RECOGNISED: Literal["recognised"] = "recognised"
"""In place of a protocol: that which the record's own steps show."""


@dataclass(frozen=True)
class RecordRequest:
    """A record to be matched."""

    source: Path | Record | ImpedanceSpectrum  # The file, or what was read from it.
    reading: FileReading = field(default_factory=FileReading)  # How the file is read.
    # As in `Experiment`; ``"recognised"`` for that which the record's own steps show.
    protocol: Protocol | Literal["recognised"] | None = None
    # scored_cycle, initial_soc: As in `Experiment`.
    scored_cycle: int | None = None
    temperature_k: float | None = None  # Ambient temperature, K, in place of that of the source.
    initial_soc: float | None = None
    # Makes a long record of it: these cycles are compared by their curves, all others by the cycle table.
    detailed_cycles: Sequence[int] | Literal["auto"] | None = None
    # Of a life, whose protocol is recognised: so many cycles are fitted, the later ones held out; None fits all.
    fit_cycles: int | None = None
    shown_protocol: Protocol = ()  # What a recognised protocol came to, where that is known already.
    initial_voltage: float | None = None  # Open-circuit voltage at the start of the life that it is a part of, V.
    whole_name: str = ""  # Name of the life that it is a part of, which its notes describe; empty where it is none.

    @property
    def as_measured(self) -> bool:
        """Whether the record says all of how it was made: currents in A, not rates, and where it starts."""
        return self.protocol in (None, RECOGNISED)

    def protocol_of(self, record: Record) -> Protocol | None:
        """The protocol of its experiment."""
        if self.protocol == RECOGNISED:
            return self.shown_protocol or recognised_protocol(record.trajectory, record.name)
        return self.protocol

    def load(self) -> Record | ImpedanceSpectrum:
        """What its source holds, at its temperature if it has one. Raises `BsaError` if the file cannot be read."""
        found = self.reading.read(self.source) if isinstance(self.source, Path) else self.source
        if self.temperature_k is None:
            return found
        if isinstance(found, Record):
            return replace(found, ambient_k=self.temperature_k)
        return replace(found, temperature_k=self.temperature_k)

    @property
    def is_life(self) -> bool:
        """Whether it is a record of equal cycles whose protocol its steps show."""
        return self.protocol == RECOGNISED and self.detailed_cycles is not None

    def as_life(self, fit_cycles: int | None = None) -> RecordRequest:
        """The same record, compared as a whole life."""
        return replace(self, protocol=RECOGNISED, detailed_cycles="auto", fit_cycles=fit_cycles)

    def parts(self) -> list[RecordRequest]:
        """A request for each part of the record whose charge is known; see `parts_between_gaps`.

        Those of a life are what is fitted and what is forecast. A spectrum has no parts.
        """
        record = self.load()
        if not isinstance(record, Record):
            if self.detailed_cycles is not None:
                raise BsaError(
                    f"{record.name} is an impedance spectrum: it is no life, and has no cycles.",
                    "fit it beside the voltage of the fresh cell, without --life.",
                )
            return [replace(self, source=record)]
        if self.is_life and record.trajectory.cycle_table is None:
            voltage, _ = open_circuit_start(record.trajectory)
            return [replace(part, initial_voltage=voltage) for part in as_life(self, record)]
        if self.protocol is not None or self.detailed_cycles is not None:
            return [replace(self, source=record)]
        return [
            replace(self, source=part, initial_soc=self.initial_soc if _begins_with(part, record) else None)
            for part in parts_between_gaps(record)
        ]


def _begins_with(part: Record, whole: Record) -> bool:
    return bool(part.trajectory.time[0] == whole.trajectory.time[0])


def parse_cycles(text: str) -> tuple[int, int]:
    """``"3"`` or ``"2-5"`` as a first and a last cycle. Raises `BsaError` if the text is neither."""
    first, _, last = text.partition("-")
    try:
        begin, end = int(first), int(last or first)
    except ValueError:
        raise BsaError(f'"{text}" is not a range of cycles.', 'write "3" or "2-5".') from None
    if not 1 <= begin <= end:
        hint = f'write "{end}-{begin}".' if 1 <= end < begin else 'cycles count from 1: write "3" or "2-5".'
        raise BsaError(f'"{text}" is not a range of cycles.', hint)
    return begin, end
