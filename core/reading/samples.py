"""The signals of a file in SI units, before they are a record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import BsaError
from ..printable import counted, shown, were
from ..record import Signal
from ..trajectory import FloatArray

Mask = NDArray[np.bool_]

Counter = Literal["net_ah", "charged_ah", "discharged_ah"]
"""A cycler's own counters of charge, in A.h."""

Extra = Literal["step", "cycle", "test", "date", "day", "other_date", "ambient_k"] | Counter
"""What a file may say beside the signals: numbers of steps, cycles and tests (a clock restarts with each), date in s
since 1970, in place of it a day that has no time, the same with month and day exchanged where the file leaves that
open, temperature around the cell in K, counters in A.h."""


@dataclass(frozen=True)
class Samples:
    """The signals of a file in SI units, in the sign convention of the file."""

    source: str  # Name of the file, for messages.
    # time, voltage, current: s, V and A; NaN where a cell is empty. Shape (n,).
    time: FloatArray
    voltage: FloatArray
    current: FloatArray
    temperature: FloatArray | None = None  # Kelvin, NaN where a cell is empty. Shape (n,).
    # Row of each sample in its file or sheet, from 1, for messages; left out, the samples are counted. Shape (n,).
    rows: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    names: Mapping[Signal, str] = field(default_factory=dict)  # Columns as the file names them, for messages.
    without_unit: tuple[Signal, ...] = ()  # Signals whose unit neither the file nor a person says.
    # ``COLUMN=VALUE`` of the first test, by each column that numbers the tests of a file whose clock restarts; None
    # where nobody looked.
    tests_by: tuple[str, ...] | None = None
    notes: tuple[str, ...] = ()  # What was done so far.
    # Whether the day comes before the month in the file's dates, as some of them tell; None where none does.
    day_first: bool | None = None
    # Ambient temperature of the whole file, where it says one; for one that changes see `Extra`.
    ambient_k: float | None = None
    sheets: tuple[str, ...] = ()  # Parts that the samples come from: ``"sheet Channel_1-008"``, or the names of files.
    sheet: NDArray[np.int64] | None = None  # Part of each sample. Shape (n,).
    # What the file says beside the signals (see `Extra`), NaN where a cell is empty. Shape (n,).
    extra: Mapping[Extra, FloatArray] = field(default_factory=dict)
    # Samples that no instrument took, put where the current was switched (see `Trajectory`). Shape (n,).
    inserted: Mask = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))

    def __post_init__(self) -> None:
        object.__setattr__(self, "source", shown(self.source))
        for name in ("time", "voltage", "current", "temperature"):
            values = getattr(self, name)
            if values is not None or name != "temperature":
                object.__setattr__(self, name, self._numbers(name, values))
        extra = {name: self._numbers(name, values) for name, values in self.extra.items()}
        object.__setattr__(self, "extra", extra)
        if len(self.rows) != len(self.time):
            object.__setattr__(self, "rows", np.arange(1, len(self.time) + 1))
        if len(self.inserted) != len(self.time):
            object.__setattr__(self, "inserted", np.zeros(len(self.time), dtype=np.bool_))

    def _numbers(self, name: str, values: object) -> FloatArray:
        """What a reader gave under a name, as one number for every sample."""
        try:
            found = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise BsaError(f"{self.source}: {name} is no array of numbers ({shown(error, 100)}).") from None
        if found.ndim != 1 or found.shape != np.shape(self.time):
            raise BsaError(
                f"{self.source}: {name} has shape {found.shape}, but time has shape {np.shape(self.time)}.",
                "a reader gives one value of each signal for every sample.",
            )
        return found

    def __len__(self) -> int:
        return len(self.time)

    def place(self, index: int) -> str:
        """Where a sample stands: ``row 12``, or ``row 12 of sheet Channel_1-008``."""
        return f"row {self.rows[index]}{self._of_sheet(index)}"

    def _of_sheet(self, index: int) -> str:
        return "" if self.sheet is None or not self.sheets else f" of {self.sheets[int(self.sheet[index])]}"

    def places(self, indices: Sequence[int] | NDArray[np.intp]) -> str:
        """Where some samples stand, the first five of them."""
        some = [int(k) for k in indices[:5]]
        more = f" and {len(indices) - 5} more" if len(indices) > 5 else ""
        if len(some) > 1 and len({self._of_sheet(k) for k in some}) == 1:
            return "rows " + ", ".join(str(self.rows[k]) for k in some) + self._of_sheet(some[0]) + more
        return ", ".join(self.place(k) for k in some) + more

    def column(self, signal: Signal) -> str:
        """The column's name in quotes."""
        return f'"{self.names.get(signal, signal)}"'

    def kept(self, keep: Mask | NDArray[np.intp], note: str = "") -> Samples:
        """The samples where ``keep`` is true, or those that it names, with one more note."""
        return replace(
            self,
            rows=self.rows[keep],
            time=self.time[keep],
            voltage=self.voltage[keep],
            current=self.current[keep],
            temperature=None if self.temperature is None else self.temperature[keep],
            sheet=None if self.sheet is None else self.sheet[keep],
            extra={name: values[keep] for name, values in self.extra.items()},
            inserted=self.inserted[keep],
            notes=(*self.notes, note) if note else self.notes,
        )

    def without(self, left_out: Mask, which: str) -> Samples:
        """The samples but those to be left out, with a note that says ``which`` these are: ``"without a value"``."""
        rows = np.flatnonzero(left_out)
        if len(rows) == 0:
            return self
        said = f"{counted(len(rows), 'sample')} {which} {were(len(rows))} left out ({self.places(rows)})."
        return self.kept(~left_out, said)

    def noted(self, note: str) -> Samples:
        """The same samples with one more note."""
        return replace(self, notes=(*self.notes, note))
