"""An impedance spectrum as a record: what a fit compares, step by step, on a clock of decades."""

import numpy as np

from ..cell import FREQUENCY, REACTANCE, RESISTANCE
from ..errors import BsaError
from ..spectrum import ComplexArray, ImpedanceSpectrum
from ..trajectory import FloatArray, Step, StepKind, Trajectory

_FEWEST = 5
"""Points without which a spectrum has no shape."""


def spectrum_record(spectrum: ImpedanceSpectrum) -> Trajectory:
    """A spectrum as a trajectory of one step.

    Its clock counts the decades below the highest frequency, so that each decade weighs the same. Inductive points at
    high frequencies are left out, for inductance lies in the leads and in no cell model: the record begins where the
    spectrum crosses the real axis, between two points. Raises `BsaError` if fewer than five points are left.
    """
    left_out = inductive_points(spectrum)
    frequency, impedance = spectrum.frequency[left_out:], spectrum.impedance[left_out:]
    if len(frequency) < _FEWEST:
        raise BsaError(
            f"{spectrum.name} has {len(frequency)} points that are not inductive; at least {_FEWEST} are needed.",
            "measure to lower frequencies, or check the sign of the imaginary part.",
        )
    crossing = spectrum.ohmic_frequency
    if left_out and crossing is not None and crossing > frequency[0]:
        frequency = np.append(crossing, frequency)
        impedance = np.append(spectrum.at(crossing).real, impedance)
    return Trajectory(
        np.log10(frequency[0] / frequency),
        steps=(Step(StepKind.SPECTRUM, 0, len(frequency)),),
        signals={FREQUENCY.name: frequency, **parts_of(impedance)},
    )


def inductive_points(spectrum: ImpedanceSpectrum) -> int:
    """How many points are inductive, from the highest frequency on."""
    capacitive = spectrum.impedance.imag <= 0
    return int(np.argmax(capacitive)) if capacitive.any() else len(spectrum)


def parts_of(impedance: ComplexArray) -> dict[str, FloatArray]:
    """The signals of an impedance: real part, negative imaginary part and size, ohm."""
    return {RESISTANCE.name: impedance.real, REACTANCE.name: -impedance.imag, RESISTANCE.share_of: np.abs(impedance)}


def recorded_spectrum(name: str, record: Trajectory) -> ImpedanceSpectrum:
    """The inverse of `spectrum_record`, without the inductive points."""
    impedance = record.values(RESISTANCE.name) - 1j * record.values(REACTANCE.name)
    return ImpedanceSpectrum(name, record.values(FREQUENCY.name), impedance)
