"""Impedance spectra as records of a task."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...core.comparison.spectrum_record import inductive_points, spectrum_record
from ...core.errors import BsaError
from ...core.printable import rounded
from ...core.spectrum import ImpedanceSpectrum
from ...core.task import CellModel, Experiment

if TYPE_CHECKING:
    from .record_request import RecordRequest

_MILLI = 1000.0
"""Ratio of the units that are confused. Ohmic drops of usual cells at 1C are 10 to 300 mV: a thousandth of a voltage
window is as far below that as the window is above it."""


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
        temperature_k=spectrum.temperature_k,
        initial_soc=request.initial_soc,
        initial_voltage=spectrum.voltage if request.initial_soc is None else None,
    )


def spectrum_notes(request: RecordRequest, cell: CellModel, use: str = "") -> list[str]:
    """What was assumed or left out of a spectrum of a cell; ``use`` stands behind its name."""
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
            f"{left_out} of {len(spectrum)} points, above {rounded(first, 3)} Hz, are inductive and left "
            "out: inductance lies in the leads."
        )
    notes += _unlikely_unit(spectrum, cell)
    return [f"{spectrum.name}{use}: {note}" for note in notes]


def _unlikely_unit(spectrum: ImpedanceSpectrum, cell: CellModel) -> list[str]:
    """Whether the unit is to be asked for: no current of 1C would pass the cell, or none would show in its voltage."""
    if not cell.parameter_set:
        return []
    from ...plugins.pybamm.cells.nameplate import nominal_capacity_ah
    from ...plugins.pybamm.cells.parameter_sets import load, voltage_window

    empty_v, full_v = voltage_window(load(cell.parameter_set))
    window_v, capacity_ah = full_v - empty_v, nominal_capacity_ah(cell.parameter_set, cell.overrides)
    least = float(np.min(np.abs(spectrum.impedance)))
    drop_v = least * capacity_ah
    if window_v / _MILLI <= drop_v <= window_v:
        return []
    meant = "mohm" if drop_v > window_v else "ohm"
    return [
        f"its impedance is {rounded(least, 3)} ohm or more: {rounded(drop_v, 3)} V at 1C of a cell of "
        f"{rounded(capacity_ah, 3)} A.h, which has {rounded(window_v, 3)} V between its cut-offs. Is it in {meant}? "
        f"Then say --reader-option unit={meant}."
    ]


def ohmic_resistances(requests: Sequence[RecordRequest]) -> list[float]:
    """Where spectra cross the real axis, as far as they do, ohm."""
    found = [_spectrum(request).ohmic_resistance for request in requests]
    return [resistance for resistance in found if resistance is not None]


def _spectrum(request: RecordRequest) -> ImpedanceSpectrum:
    assert isinstance(request.source, ImpedanceSpectrum)
    return request.source
