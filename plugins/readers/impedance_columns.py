"""The columns of a table that are those of an impedance spectrum."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...core.record import ImpedancePart
from .columns import split_name

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


def holds_spectrum(header: Sequence[str]) -> bool:
    """Whether the columns are those of an impedance spectrum."""
    return spectrum_columns(header, {}) is not None


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
