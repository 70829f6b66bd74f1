"""Rates that lie far from those of every other installed set."""

import pytest
from bsa.plugins.pybamm.before_search.activation_energies import with_activation_energies
from bsa.plugins.pybamm.before_search.nearest_potentials import published_potentials
from bsa.plugins.pybamm.before_search.usual_rates import unusual_rates, with_usual_rates
from bsa.plugins.pybamm.cells.parameter_files import parsed
from bsa.plugins.pybamm.cells.parameter_sets import load, pybamm

DIFFUSIVITY = "Negative particle diffusivity [m2.s-1]"
EXCHANGE = "Negative electrode exchange-current density [A.m-2]"


def diffusivity(source: object, kelvin: float = 298.15) -> float:
    values = load(source)  # type: ignore[arg-type]
    symbol = values[DIFFUSIVITY](pybamm.Scalar(0.5), pybamm.Scalar(kelvin))
    return float(values.process_symbol(symbol).evaluate())


def test_one_installed_set_has_rates_far_from_all_others() -> None:
    found = {name: unusual_rates(name) for name in published_potentials("Negative")}
    assert [name for name, rates in found.items() if rates] == ["NCA_Kim2011"]
    assert list(found["NCA_Kim2011"]) == [DIFFUSIVITY, EXCHANGE]


def test_such_rates_become_the_nearest_of_the_others_at_every_temperature() -> None:
    unusual = unusual_rates("NCA_Kim2011")
    mended = with_usual_rates("NCA_Kim2011", unusual)
    assert unusual_rates(mended) == {}
    for kelvin in (298.15, 318.15):
        ratio = diffusivity(mended, kelvin) / diffusivity("NCA_Kim2011", kelvin)
        assert ratio == pytest.approx(unusual[DIFFUSIVITY])
    # D / R^2 of the others lies between 8e-6 and 9.8e-3 1/s.
    rate = diffusivity(mended) / load(mended)["Negative particle radius [m]"] ** 2
    assert rate == pytest.approx(9.75e-3, rel=1e-3)
    assert parsed("kim.json", mended.text).kind == "parameter-values"


def test_a_set_that_was_changed_elsewhere_is_not_compared_with_itself() -> None:
    warmed = with_activation_energies("Chen2020", (DIFFUSIVITY,))
    assert unusual_rates(warmed) == {}
    slowed = with_usual_rates("Chen2020", {DIFFUSIVITY: 1e-6})
    ((name, factor),) = unusual_rates(slowed).items()
    assert name == DIFFUSIVITY
    assert factor > 1e3
