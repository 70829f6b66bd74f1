"""Impedance spectra as records of a task."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ...core.comparison.spectrum_record import inductive_points, spectrum_record
from ...core.errors import BsaError
from ...core.spectrum import ImpedanceSpectrum
from ...core.task import Experiment

if TYPE_CHECKING:
    from .record_request import RecordRequest


def spectrum_experiment(request: RecordRequest) -> Experiment:
    """What is asked of a spectrum: the impedance of each candidate's cell at rest.

    Its state of charge is the request's, or that at which the candidate's own cell shows the spectrum's voltage.

    Raises `BsaError` if neither is known, or too few points are left.
    """
    spectrum = _spectrum(request)
    if request.initial_soc is None and spectrum.voltage is None:
        raise BsaError(
            f"{spectrum.name} has no voltage, so that its state of charge is not known.",
            "give --initial-soc (in a task file initial_soc), one for each record.",
        )
    return Experiment(
        name=spectrum.name,
        target=spectrum_record(spectrum),
        temperature_k=spectrum.temperature_k if request.temperature_k is None else request.temperature_k,
        initial_soc=request.initial_soc,
        initial_voltage=spectrum.voltage if request.initial_soc is None else None,
    )


def spectrum_notes(request: RecordRequest, use: str = "") -> list[str]:
    """What was assumed or left out of a spectrum; ``use`` stands behind its name."""
    spectrum = _spectrum(request)
    notes = list(spectrum.notes)
    if request.initial_soc is not None:
        notes.append(f"impedance at a state of charge of {request.initial_soc:.3f}, as given.")
    elif spectrum.voltage is not None:
        notes.append(f"impedance at the state of charge at which the simulated cell shows {spectrum.voltage:.3f} V.")
    left_out = inductive_points(spectrum)
    if 0 < left_out < len(spectrum):
        first = spectrum.frequency[left_out]
        notes.append(
            f"{left_out} of {len(spectrum)} points, above {first:.3g} Hz, are inductive and left "
            "out: inductance lies in the leads."
        )
    return [f"{spectrum.name}{use}: {note}" for note in notes]


def ohmic_resistances(requests: Sequence[RecordRequest]) -> list[float]:
    """Where spectra cross the real axis, as far as they do, ohm."""
    found = [_spectrum(request).ohmic_resistance for request in requests]
    return [resistance for resistance in found if resistance is not None]


def _spectrum(request: RecordRequest) -> ImpedanceSpectrum:
    assert isinstance(request.source, ImpedanceSpectrum)
    return request.source
