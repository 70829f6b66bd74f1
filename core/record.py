"""What a reader takes and gives: a file of a cycler in, a record of one cell out."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol, get_args, runtime_checkable

from pydantic import BaseModel, Field, field_validator
from scipy.constants import zero_Celsius

from .printable import counted
from .trajectory import Trajectory

if TYPE_CHECKING:
    from .reading.samples import Samples
    from .spectrum import ImpedanceSpectrum

Signal = Literal["time", "voltage", "current", "temperature"]
ImpedancePart = Literal["frequency", "real", "imaginary", "magnitude", "phase"]
"""What a column of an impedance spectrum may hold: real and imaginary part, or magnitude and phase."""

CurrentSign = Literal["charge-positive", "discharge-positive", "auto"]

AMBIENT_C = (-100.0, 200.0)
"""Between these an ambient temperature lies, degC: beyond is one in another unit."""


@dataclass(frozen=True, eq=False)
class Record:
    """What was measured on one cell.

    Attributes
    ----------
    name : str
        Name of the file, printable.
    trajectory : Trajectory
        The samples in SI units, current positive on discharge, cut into steps.
    notes : tuple of str
        Everything that was assumed or repaired, with row numbers; shown to the user.
    ambient_k : float or None
        Ambient temperature in kelvin, where known.
    charged_gaps_s : tuple of float
        Times of the last samples before silences in which charge passed, by the file's own counter, s on the clock of
        the trajectory.
    """

    name: str
    trajectory: Trajectory
    notes: tuple[str, ...] = ()
    ambient_k: float | None = None
    charged_gaps_s: tuple[float, ...] = ()

    def __repr__(self) -> str:
        return f"<Record {self.name}: {self._words}>"

    def _repr_html_(self) -> str:
        notes = "".join(f"<li>{escape(note)}</li>" for note in self.notes)
        return f"<p><b>{escape(self.name)}</b>: {escape(self._words)}</p>" + f"<ul>{notes}</ul>" * bool(notes)

    @property
    def _words(self) -> str:
        ambient = "" if self.ambient_k is None else f"; ambient temperature {self.ambient_k - zero_Celsius:.1f} degC"
        return self.trajectory.words + ambient + f"; {counted(len(self.notes), 'note')}" * bool(self.notes)


class ReadOptions(BaseModel, extra="forbid", frozen=True):
    """What the user knows about a file and its header does not say."""

    columns: dict[Signal | ImpedancePart, str] = Field(
        default={},
        description="Column of each signal, or of each part of an impedance, by its name in the file (or its number, "
        "where it has none).",
    )
    units: dict[Signal, str] = Field(default={}, description='Unit of each signal, in place of the header\'s: "mV".')
    current_sign: CurrentSign = Field(
        default="charge-positive",
        description="Whether the file's current is positive on charge (cyclers) or on discharge, or to be found out.",
    )
    constant_current_a: float | None = Field(
        default=None,
        allow_inf_nan=False,
        description="Current in A for a file without a current column, in the sign convention of `current_sign`.",
    )
    current_offset_a: float | None = Field(
        default=None,
        allow_inf_nan=False,
        description="What the instrument adds to every current that is not zero, in A, positive on charge whatever the "
        "file's sign; it is taken off. Left out: nothing, but a fit searches it where a record does not bring its "
        "charge back.",
    )
    voltage_lag_s: float | None = Field(
        default=None,
        allow_inf_nan=False,
        description="How much later than the current the instrument writes the voltage, in s; it is taken back. Left "
        "out: what a varying current shows.",
    )
    where: dict[str, str] = Field(
        default={}, description='Keep only the rows in which a column has this value: {"test_id": "1"}.'
    )
    join: bool = Field(
        default=False, description="Whether all files, and the tests in a file, are of one cell and follow each other."
    )
    cycles: tuple[int, int] | None = Field(default=None, description="First and last cycle to keep, counted from 1.")
    sheet: str | None = Field(default=None, description="Sheet of a workbook, or test inside a file of several.")
    ambient_c: float | None = Field(
        default=None,
        gt=AMBIENT_C[0],
        lt=AMBIENT_C[1],
        description="Ambient temperature in degC, in place of what the file says.",
    )

    @property
    def signal_columns(self) -> dict[Signal, str]:
        """The columns of signals over time, without those of an impedance."""
        return {signal: self.columns[signal] for signal in get_args(Signal) if signal in self.columns}

    @property
    def impedance_columns(self) -> dict[ImpedancePart, str]:
        """The columns of an impedance."""
        return {part: self.columns[part] for part in get_args(ImpedancePart) if part in self.columns}

    @field_validator("cycles")
    @classmethod
    def _ordered(cls, cycles: tuple[int, int] | None) -> tuple[int, int] | None:
        if cycles is not None and not 1 <= cycles[0] <= cycles[1]:
            raise ValueError("1 <= first <= last must hold")
        return cycles


@runtime_checkable
class Reader(Protocol):
    """Reads one kind of file."""

    def matches(self, path: Path) -> bool:
        """Whether the file looks like this reader's kind, from its name and its first bytes.

        Cheap, and false rather than an error for anything strange.
        """

    def read(self, path: Path, options: ReadOptions) -> Samples | ImpedanceSpectrum:
        """Read the signals of the file, or the impedance spectrum that it holds.

        The columns, units, rows and sheet of ``options`` are the reader's to honour, and ``constant_current_a`` where
        the file has no current. Sign, cycles, ambient temperature and all checks are not: they are the same for every
        reader and follow.

        Returns
        -------
        Samples or ImpedanceSpectrum
            In SI units, the current with the sign that it has in the file.

        Raises
        ------
        BsaError
            Naming the file, the row or column at fault and its value.
        """
