"""The columns of a table that are those of an impedance spectrum."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...core.reading.samples import Mask
from ...core.record import ImpedancePart
from ...core.trajectory import FloatArray
from .columns import signal_of, split_name

_MOSTLY = 0.5
"""Share of rows without a frequency from which a table with columns of both is a record."""

_PARTS: Mapping[ImpedancePart, tuple[str, ...]] = {
    "frequency": ("actfreq", "freq", "frequency", "f", "omega", "omegarad", "angularfrequency", "ω", "ωrad"),
    "real": ("zreal", "zreal1", "zre", "rez", "re", "real"),
    "imaginary": ("zimag", "zimg", "zimg1", "zimag1", "zim", "imz", "im", "imag", "imaginary"),
    "magnitude": ("z", "absz", "zabs", "modz", "zmod", "magz", "zmag", "magnitude", "modulus"),
    "phase": ("phasez", "zphz", "zphase", "phase", "phaseangle", "phasedeg", "phi", "theta"),
}


@dataclass(frozen=True)
class SpectrumColumns:
    """Places of the three columns."""

    frequency: int
    first: int  # Real part, or magnitude.
    second: int  # Imaginary part, or phase.
    polar: bool  # Whether it is a magnitude and a phase.
    turned: bool  # Whether the imaginary part, or the phase, is written with its sign turned.


def is_of_a_record(header: Sequence[str], frequency: FloatArray) -> bool:
    """Whether columns of a spectrum stand beside those of a record, and most rows have no frequency.

    ``frequency`` is that of each row, NaN where it has none.
    """
    if not {"time", "voltage", "current"} <= {signal_of(name) for name in header}:
        return False
    return len(frequency) > 0 and float(np.mean(frequency > 0.0)) < 1.0 - _MOSTLY


def are_points(frequency: FloatArray, first: FloatArray, second: FloatArray) -> Mask:
    """Which rows are points of a spectrum: those with a frequency and both parts of an impedance; shape (n,)."""
    return np.isfinite(frequency) & np.isfinite(first) & np.isfinite(second) & (frequency > 0)


def spectrum_columns(header: Sequence[str], said: Mapping[ImpedancePart, str]) -> SpectrumColumns | None:
    """The columns of a spectrum, by what a person says of them and by their names."""
    bases = [base_of(name) for name in header]
    places = {
        part: header.index(said[part])
        if part in said
        else next((bases.index(name) for name in names if name in bases), None)
        for part, names in _PARTS.items()
    }
    kinds: list[tuple[ImpedancePart, ImpedancePart]] = [("real", "imaginary"), ("magnitude", "phase")]
    kinds.sort(key=lambda parts: -sum(part in said for part in parts))
    frequency = places["frequency"]
    for one, other in kinds:
        first, second = places[one], places[other]
        if frequency is not None and first is not None and second is not None:
            turned = header[second].strip().startswith("-")
            return SpectrumColumns(frequency, first, second, one == "magnitude", turned)
    return None


def base_of(name: str) -> str:
    """The name without its unit and sign; Z' is the real part, Z'' the imaginary one."""
    spelt = name.replace("''", "imag").replace('"', "imag").replace("'", "real")
    return split_name(spelt.strip())[0]
