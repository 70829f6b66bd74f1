"""What an impedance measurement gives: a complex resistance at each frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import BsaError
from .trajectory import FloatArray

ComplexArray = NDArray[np.complex128]


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

    @property
    def ohmic_resistance(self) -> float | None:
        """Real part where the imaginary part first changes its sign, from high frequencies on, in ohm."""
        imaginary = self.impedance.imag
        crossings = np.flatnonzero((imaginary[:-1] > 0) & (imaginary[1:] <= 0))
        if len(crossings) == 0:
            return None
        k = int(crossings[0])
        share = imaginary[k] / (imaginary[k] - imaginary[k + 1])
        return float((1 - share) * self.impedance.real[k] + share * self.impedance.real[k + 1])
