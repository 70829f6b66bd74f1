"""Spectra: where they mark frequencies, and how one is held against another."""

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.spectrum import ImpedanceSpectrum, compare

FREQUENCY = np.logspace(4, -3, 71)


def cell(ohmic: float, arc: float, tail: float = 2e-3) -> ImpedanceSpectrum:
    """A resistance, an arc at 16 Hz, a Warburg tail and the inductance of leads."""
    omega = 2 * np.pi * FREQUENCY
    impedance = ohmic + arc / (1 + 1j * omega * 0.01) + tail * (1 - 1j) / np.sqrt(omega) + 1j * omega * 1e-7
    return ImpedanceSpectrum("z.csv", FREQUENCY, impedance, voltage=3.7)


def test_a_spectrum_against_one_of_other_resistances() -> None:
    measured, simulated = cell(0.020, 0.010), cell(0.025, 0.014)
    found = compare(measured, simulated)
    assert found.ohmic_simulated_mohm - found.ohmic_mohm == pytest.approx(5.0, abs=0.3)
    assert found.arcs_mohm == pytest.approx(10.0, rel=0.1)
    assert found.arcs_simulated_mohm == pytest.approx(14.0, rel=0.1)
    assert 5.0 < found.rms_mohm < 9.0
    assert found.words.startswith("ohmic 25.")
    assert compare(measured, measured).rms_mohm == 0.0


def test_inductance_is_not_held_against_a_model() -> None:
    measured = cell(0.020, 0.010)
    leads = replace(measured, impedance=measured.impedance.real + 1j * np.minimum(measured.impedance.imag, 0.0))
    assert compare(measured, leads).rms_mohm < 0.1
    assert np.abs(leads.impedance - measured.impedance).max() > 5e-3


def test_arcs_that_run_into_the_tail_are_not_told() -> None:
    found = compare(cell(0.02, 0.0), cell(0.02, 0.0))
    assert found.arcs_hz is None
    assert "arcs" not in found.words
    bare = ImpedanceSpectrum("r", FREQUENCY, np.full(71, 0.03 - 1e-4j))
    assert compare(bare, bare).ohmic_hz == FREQUENCY[0]
