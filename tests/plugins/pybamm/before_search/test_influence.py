"""A model is asked which of the searched parameters it depends on."""

from typing import Any

import pytest
from bsa.core.target import target_named
from bsa.core.task import CellModel
from bsa.plugins.pybamm.before_search.influence import without_influence
from bsa.plugins.pybamm.before_search.presets import preset_space
from bsa.plugins.pybamm.cells.parameter_sets import load

LUMPED = {"thermal": "lumped"}
POROUS = {
    "Negative electrode porosity",
    "Positive electrode porosity",
    "Negative electrode Bruggeman coefficient (electrolyte)",
    "Positive electrode Bruggeman coefficient (electrolyte)",
}
ELECTROLYTE = {
    "Electrolyte conductivity [S.m-1] factor",
    "Electrolyte diffusivity [m2.s-1] factor",
    "Thermodynamic factor",
}


def idle(preset: str, model: str, parameter_set: str = "Chen2020", **options: str) -> set[str]:
    space = preset_space(parameter_set, preset, options=options)
    return set(without_influence(CellModel(parameter_set, model, options), space.targets))


def test_the_spm_has_no_electrolyte() -> None:
    assert idle("geometry", "SPM") == POROUS | {"Separator thickness [m]"}
    assert idle("cell", "SPM") == ELECTROLYTE
    assert idle("life", "SPM", SEI="solvent-diffusion limited") == ELECTROLYTE
    # A number in this set is searched as it is.
    assert "Electrolyte diffusivity [m2.s-1]" in idle("cell", "SPM", "Prada2013")
    # Of a lumped cell the separator has a share of the heat capacity.
    assert idle("geometry", "SPM", thermal="lumped") == POROUS


@pytest.mark.slow
@pytest.mark.parametrize("model", ["SPMe", "DFN"])
@pytest.mark.parametrize("preset", ["geometry", "cell", "life"])
def test_models_with_an_electrolyte_depend_on_all_of_every_preset(preset: str, model: str) -> None:
    options = {"SEI": "solvent-diffusion limited", "contact resistance": "true", "surface form": "differential"}
    assert idle(preset, model, **options) == set()


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("Cell volume [m3]", LUMPED),
        ("Total heat transfer coefficient [W.m-2.K-1]", LUMPED),
        ("Contact resistance [Ohm]", {"contact resistance": "true"}),
        ("Negative electrode double-layer capacity [F.m-2]", {"surface form": "differential"}),
    ],
)
def test_what_an_option_switches_on_is_idle_without_it(name: str, options: dict[str, Any]) -> None:
    targets = {name: target_named(name, load("Chen2020"))}
    assert without_influence(CellModel("Chen2020", "SPM"), targets) == [name]
    assert without_influence(CellModel("Chen2020", "SPM", options), targets) == []


def test_what_acts_outside_of_the_equations_has_influence() -> None:
    names = ["Initial state of charge", "Cyclable lithium factor", "Nominal cell capacity [A.h]"]
    known = load("Chen2020")
    assert without_influence(CellModel("Chen2020", "SPM"), {name: target_named(name, known) for name in names}) == []
