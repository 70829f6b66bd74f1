"""The impedance of a fitted cell."""

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.parameters import ParameterSpace
from bsa.core.spectrum import ImpedanceSpectrum
from bsa.core.task import CellModel
from bsa.plugins.pybamm.impedance import simulate_spectrum
from bsa.plugins.pybamm.presets import resolve_space

FREQUENCY = np.logspace(3, -2, 11)
CONTACT = "Contact resistance [Ohm]"


def spectrum(voltage: float | None = 3.8) -> ImpedanceSpectrum:
    return ImpedanceSpectrum("z.csv", FREQUENCY, np.full(11, 0.02), voltage, 298.15)


def test_what_a_candidate_changes_shows_in_its_impedance() -> None:
    space = resolve_space(
        "Chen2020", {CONTACT: [0.0, 0.1], "Positive electrode exchange-current density [A.m-2] factor": [0.1, 10]}
    )
    cell = CellModel("Chen2020", "SPM", {"contact resistance": "true"})
    base = dict(zip(space.names, (0.0, 1.0), strict=True))
    plain, soc = simulate_spectrum(cell, space, base, spectrum())
    clamped, _ = simulate_spectrum(cell, space, {**base, CONTACT: 0.03}, spectrum())
    sluggish, _ = simulate_spectrum(cell, space, {**base, space.names[1]: 0.3}, spectrum())
    assert 0.4 < soc < 0.7
    assert clamped.impedance - plain.impedance == pytest.approx(0.03)
    # Slow reactions widen the arc: nothing at high frequencies, all of it at low ones.
    further = sluggish.impedance.real - plain.impedance.real
    assert abs(further[0]) < 1e-4
    assert further[-3:] == pytest.approx(further[-1], rel=0.01)
    assert further[-1] > 1e-3


def test_a_state_of_charge_is_known_or_asked_for() -> None:
    cell, space = CellModel("Chen2020", "SPM"), ParameterSpace(())
    _, soc = simulate_spectrum(cell, space, {}, spectrum(None), 0.25)
    assert soc == 0.25
    with pytest.raises(BsaError, match="has no voltage"):
        simulate_spectrum(cell, space, {}, spectrum(None))
    with pytest.raises(BsaError, match="cannot be simulated"):
        simulate_spectrum(cell, space, {}, spectrum(None), 3.0)
