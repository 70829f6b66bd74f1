"""The signals of a file in SI units, before they are a record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...core.record import Signal
from ...core.trajectory import FloatArray

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Samples:
    """The signals of a file in SI units, in the sign convention of the file.

    Attributes
    ----------
    source : str
        Printable name of the file.
    rows : ndarray of shape (n,)
        Row of each sample in its file or sheet, from 1.
    time, voltage, current : ndarray of shape (n,)
        s, V and A; NaN where a cell is empty.
    temperature : ndarray of shape (n,) or None
        Kelvin, NaN where a cell is empty.
    names : mapping
        Columns as the file names them, for messages.
    notes : tuple of str
        What was done so far.
    ambient_k : float or None
        Ambient temperature, where the file has it.
    sheets : tuple of str
        Sheets (or workbooks and sheets) that the samples come from.
    sheet : ndarray of shape (n,)
        Sheet of each sample.
    """

    source: str
    rows: NDArray[np.int64]
    time: FloatArray
    voltage: FloatArray
    current: FloatArray
    temperature: FloatArray | None = None
    names: Mapping[Signal, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    ambient_k: float | None = None
    sheets: tuple[str, ...] = ()
    sheet: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.time)

    def place(self, index: int) -> str:
        """Where a sample stands: ``row 12``, or ``row 12 of sheet Channel_1-008``."""
        row = f"row {self.rows[index]}"
        if self.sheet is None or not self.sheets:
            return row
        return f"{row} of sheet {self.sheets[int(self.sheet[index])]}"

    def places(self, indices: Sequence[int] | NDArray[np.intp]) -> str:
        """Where some samples stand, the first five of them."""
        named = [self.place(int(k)) for k in indices[:5]]
        if self.sheet is None and len(named) > 1:
            named = ["rows " + ", ".join(str(self.rows[int(k)]) for k in indices[:5])]
        return ", ".join(named) + (f" and {len(indices) - 5} more" if len(indices) > 5 else "")

    def column(self, signal: Signal) -> str:
        """The column's name in quotes."""
        return f'"{self.names.get(signal, signal)}"'

    def kept(self, keep: Mask, note: str = "") -> Samples:
        """The samples where ``keep`` is true, with one more note."""
        return replace(
            self,
            rows=self.rows[keep],
            time=self.time[keep],
            voltage=self.voltage[keep],
            current=self.current[keep],
            temperature=None if self.temperature is None else self.temperature[keep],
            sheet=None if self.sheet is None else self.sheet[keep],
            notes=(*self.notes, note) if note else self.notes,
        )

    def noted(self, note: str) -> Samples:
        """The same samples with one more note."""
        return replace(self, notes=(*self.notes, note))
