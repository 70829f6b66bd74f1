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


@pytest.mark.parametrize("share", [0.003, 0.01])
def test_the_arcs_end_where_they_do_without_noise(share: float) -> None:
    clean = cell(0.020, 0.010)
    rng = np.random.default_rng(0)
    ends, arcs = [], []
    for _ in range(100):
        noise = share * (rng.normal(size=(2, len(FREQUENCY))) / np.sqrt(2.0))
        noisy = replace(clean, impedance=clean.impedance * (1.0 + noise[0] + 1j * noise[1]))
        found = compare(noisy, clean)
        assert found.arcs_hz is not None
        assert found.arcs_simulated_mohm is not None
        ends.append(found.arcs_hz)
        arcs.append(found.arcs_simulated_mohm)
    true = compare(clean, clean)
    assert np.median(ends) == pytest.approx(true.arcs_hz, rel=0.3)  # a point of ten in a decade
    assert np.quantile(arcs, [0.1, 0.9]) == pytest.approx([true.arcs_mohm] * 2, rel=0.06)


@pytest.mark.parametrize("count", [1, 2, 4, 9])
def test_few_points_have_arcs_where_they_show_them(count: int) -> None:
    few = replace(
        cell(0.02, 0.01),
        frequency=FREQUENCY[:: 71 // count][:count],
        impedance=cell(0.02, 0.01).impedance[:: 71 // count][:count],
    )
    assert (few.arcs_end is not None) == (count == 9)


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
