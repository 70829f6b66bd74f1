"""Corrections of published potentials by a slow curve."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.reading.open_circuit import OpenCircuitCurve
from bsa.core.trajectory import FloatArray
from bsa.plugins.pybamm.before_search.balance import balanced
from bsa.plugins.pybamm.before_search.measured_potentials import Corrections, corrections
from bsa.plugins.pybamm.before_search.nearest_potentials import published_potentials
from bsa.plugins.pybamm.cells.ocp_shape import ELECTRODES, GRID, bump, corrected

BALANCE = np.array((0.88, 0.03, 0.28, 0.93, 0.005))


def pair(negative: str, positive: str) -> dict[str, FloatArray]:
    return {
        "Negative": published_potentials("Negative")[negative],
        "Positive": published_potentials("Positive")[positive],
    }


def curve_of(potentials: dict[str, FloatArray], at: FloatArray = BALANCE, hours: float = 20.0) -> OpenCircuitCurve:
    """A discharge of a cell at equilibrium."""
    share = np.linspace(0.0, 1.0, 200)
    x, y = at[0] + (at[1] - at[0]) * share, at[2] + (at[3] - at[2]) * share
    voltage = np.interp(y, GRID, potentials["Positive"]) - np.interp(x, GRID, potentials["Negative"]) - at[4]
    return OpenCircuitCurve(share, voltage, 5.0, 1, float("nan"), hours, "the slow record")


def after(potentials: dict[str, FloatArray], heights: dict[str, dict[float, float]]) -> dict[str, FloatArray]:
    return {
        which: np.asarray(corrected(lambda _, own=potentials[which]: own, heights[which], 0.6)(GRID))
        for which in ELECTRODES
    }


def corrected_by(curve: OpenCircuitCurve, potentials: dict[str, FloatArray]) -> Corrections:
    return corrections(curve, potentials, balanced(curve, potentials))


@pytest.fixture(scope="module")
def chen() -> dict[str, FloatArray]:
    return pair("Chen2020", "Chen2020")


def test_potentials_that_made_the_curve_are_hardly_corrected(chen) -> None:
    found = corrected_by(curve_of(chen), chen)
    assert found.balance.rms_v < 5e-4
    assert max(abs(height) for heights in found.heights.values() for height in heights.values()) < 0.02


def test_steps_at_other_stoichiometries_are_described(chen) -> None:
    """A step of graphite that is narrower than any bump of a search."""
    shifted = {**chen, "Negative": chen["Negative"] - 0.02 * bump(GRID, 0.5, 0.3)}
    curve = curve_of(shifted)
    before = balanced(curve, chen).rms_v
    found = corrected_by(curve, chen)
    assert before > 0.002
    assert found.balance.rms_v < 0.4 * before
    assert found.balance.at == pytest.approx(BALANCE, abs=0.06)


@pytest.mark.parametrize("positive", ["Prada2013", "Mohtat2020"])
def test_corrected_potentials_still_fall(positive: str, chen) -> None:
    """The plateau of LFP has next to no room to rise."""
    own = pair("Ecker2015", positive)
    wanted = curve_of({**own, "Negative": chen["Negative"] + 0.03 * bump(GRID, 0.7, 0.2)})
    found = corrected_by(wanted, own)
    assert found.balance.rms_v < balanced(wanted, own).rms_v
    inside = (GRID > 0.003) & (GRID < 0.997)
    for which, curve in after(own, found.heights).items():
        assert np.all(np.gradient(curve, GRID)[inside] <= np.maximum(np.gradient(own[which], GRID)[inside], 0.0) + 1e-3)


def test_of_a_flat_potential_the_usual_stoichiometries_are_taken() -> None:
    own = pair("Chen2020", "Prada2013")
    found = balanced(curve_of(own), own)
    full, empty = found.stoichiometry["Positive"]
    assert full < 0.5
    assert empty > 0.75
