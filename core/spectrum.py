"""What an impedance measurement gives: a complex resistance at each frequency."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .errors import BsaError
from .normal import robust_deviation
from .trajectory import FloatArray

ComplexArray = NDArray[np.complex128]

_ABOVE_NOISE = 4.0
"""Deviations of the noise by which an arc rises above the lowest point before it: of a falling tail of 61 points the
noise alone makes one rise by less in 97 of 100 cases."""


@dataclass(frozen=True, eq=False)
class ImpedanceSpectrum:
    """The impedance of a cell, Z = V / I, at one state of charge and temperature.

    The sign is that of PyBaMM and of circuit theory: the imaginary part is **negative where the cell is capacitive**
    (the arcs at low frequency) and positive where it is inductive (leads, at high frequency). Nyquist plots show
    its negative upwards.

    Parameters
    ----------
    name : str
        Name of the file, printable.
    frequency : ndarray of shape (n,)
        Hz, from the highest to the lowest.
    impedance : ndarray of shape (n,)
        Complex, ohm.
    voltage : float or None
        Voltage of the cell at rest, V, where known.
    temperature_k : float or None
        Temperature in kelvin, where known.
    notes : tuple of str
        Everything that was assumed or repaired.

    Raises
    ------
    BsaError
        If the shapes differ, or a value is no positive frequency or no finite number.
    """

    name: str
    frequency: FloatArray
    impedance: ComplexArray
    voltage: float | None = None
    temperature_k: float | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        frequency = np.asarray(self.frequency, dtype=np.float64)
        impedance = np.asarray(self.impedance, dtype=np.complex128)
        if frequency.ndim != 1 or frequency.shape != impedance.shape:
            raise BsaError(
                f"{self.name}: the frequencies have shape {frequency.shape}, the impedances {impedance.shape}.",
                "give one impedance for each frequency.",
            )
        if not (np.all(frequency > 0) and np.all(np.isfinite(frequency)) and np.all(np.isfinite(impedance))):
            raise BsaError(f"{self.name}: a frequency or an impedance is no finite number.", "leave out such points.")
        order = np.argsort(-frequency, kind="stable")
        object.__setattr__(self, "frequency", frequency[order])
        object.__setattr__(self, "impedance", impedance[order])

    def __len__(self) -> int:
        return len(self.frequency)

    def at(self, frequency: float) -> complex:
        """The impedance at a frequency in Hz, interpolated over its logarithm; constant beyond the ends, ohm."""
        places, logarithms = np.log(self.frequency[::-1]), np.log(frequency)
        real, imaginary = (
            float(np.interp(logarithms, places, part[::-1])) for part in (self.impedance.real, self.impedance.imag)
        )
        return complex(real, imaginary)

    @property
    def ohmic_frequency(self) -> float | None:
        """Frequency at which the imaginary part first changes its sign, from high frequencies on, Hz."""
        imaginary = self.impedance.imag
        crossings = np.flatnonzero((imaginary[:-1] > 0) & (imaginary[1:] <= 0))
        if len(crossings) == 0:
            return None
        k = int(crossings[0])
        share = imaginary[k] / (imaginary[k] - imaginary[k + 1])
        return float(self.frequency[k] * (self.frequency[k + 1] / self.frequency[k]) ** share)

    @property
    def ohmic_resistance(self) -> float | None:
        """Real part where the imaginary part first changes its sign, from high frequencies on, in ohm."""
        frequency = self.ohmic_frequency
        return None if frequency is None else self.at(frequency).real

    @property
    def arcs_end(self) -> float | None:
        """Frequency between the arcs of the reactions and the tail of the diffusion, Hz; None if they are not apart.

        Where the negative imaginary part is lowest before it first rises out of the noise, from low frequencies on.
        """
        height = -self.impedance.imag[::-1]
        rise = height - np.minimum.accumulate(height)
        if not np.any(rise):
            return None
        # Where points lie too far apart to tell the noise from the curve, the highest arc is one all the same.
        least = min(_ABOVE_NOISE * _noise_of(height), 0.5 * float(np.max(rise)))
        arc = int(np.argmax((rise > 0.0) & (rise >= least)))
        lowest = int(np.argmin(height[:arc]))
        return float(self.frequency[::-1][lowest]) if lowest else None


def _noise_of(values: FloatArray) -> float:
    """Standard deviation of noise, from third differences, which remove a smooth curve; 0 for too few values."""
    return robust_deviation(np.diff(values, 3)) / math.sqrt(math.comb(6, 3)) if len(values) > 3 else 0.0


@dataclass(frozen=True)
class SpectrumErrors:
    """A simulated spectrum against a measured one, both read at the frequencies that the measured one marks."""

    # Root mean square of the distance in the complex plane, over the frequencies up to ``ohmic_hz``: the inductance of
    # leads is in no cell model.
    rms_mohm: float
    # ohmic_hz, ohmic_mohm, ohmic_simulated_mohm: Where the measured spectrum crosses the real axis (its highest
    # frequency, if it does not), and the real parts there.
    ohmic_hz: float
    ohmic_mohm: float
    ohmic_simulated_mohm: float
    # arcs_hz, arcs_mohm, arcs_simulated_mohm: Where the measured arcs end, and by how much the real part grows up to
    # there; None if they run into the tail.
    arcs_hz: float | None = None
    arcs_mohm: float | None = None
    arcs_simulated_mohm: float | None = None

    @property
    def words(self) -> str:
        """``"ohmic 20.9 mohm (measured 21.1), arcs 8.1 (measured 9.2)"``."""
        words = f"ohmic {self.ohmic_simulated_mohm:.1f} mohm (measured {self.ohmic_mohm:.1f})"
        if self.arcs_mohm is None or self.arcs_simulated_mohm is None:
            return words
        return f"{words}, arcs {self.arcs_simulated_mohm:.1f} (measured {self.arcs_mohm:.1f})"


def compare(measured: ImpedanceSpectrum, simulated: ImpedanceSpectrum) -> SpectrumErrors:
    """The errors of a simulated spectrum that has the measured one's frequencies."""
    ohmic_hz = measured.ohmic_frequency or float(measured.frequency[0])
    judged = measured.frequency <= ohmic_hz
    rms = np.sqrt(np.mean(np.abs(simulated.impedance - measured.impedance)[judged] ** 2))
    ohmic, ours = (1e3 * spectrum.at(ohmic_hz).real for spectrum in (measured, simulated))
    arcs_hz = measured.arcs_end
    found = SpectrumErrors(1e3 * float(rms), ohmic_hz, ohmic, ours, arcs_hz)
    if arcs_hz is None:
        return found
    arcs, our_arcs = (1e3 * spectrum.at(arcs_hz).real for spectrum in (measured, simulated))
    return replace(found, arcs_mohm=arcs - ohmic, arcs_simulated_mohm=our_arcs - ours)
