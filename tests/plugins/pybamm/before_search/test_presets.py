"""Search spaces by preset and as people write them."""

from __future__ import annotations

from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.plugins.pybamm.before_search.presets import preset_space, presets, resolve_space

SETS = ["Chen2020", "ORegan2022", "Ecker2015", "Prada2013", "Marquis2019", "OKane2022", "Mohtat2020", "Ai2020"]
ALL_OPTIONS = {"SEI": "reaction limited", "SEI film resistance": "distributed", "contact resistance": "true"}


@pytest.mark.parametrize("parameter_set", SETS)
@pytest.mark.parametrize("preset", sorted(presets()))
def test_every_preset_fits_every_set(parameter_set: str, preset: str) -> None:
    space = preset_space(parameter_set, preset, options=ALL_OPTIONS)
    assert space.names
    for parameter in space:
        assert parameter.lower < parameter.initial < parameter.upper


def test_geometry_has_the_papers_nine() -> None:
    space = preset_space("Chen2020", "geometry")
    assert len(space) == 9
    radius = space["Negative particle radius [m]"]
    assert (radius.lower, radius.upper, radius.scale) == (5.86e-6 / 4, 5.86e-6 * 4, "log")


def test_functions_are_searched_as_factors() -> None:
    assert "Negative particle diffusivity [m2.s-1]" in preset_space("Chen2020", "cell")
    assert "Negative particle diffusivity [m2.s-1] factor" in preset_space("Marquis2019", "cell")


def test_priors_come_from_the_preset_and_a_person_can_give_one() -> None:
    name = "Positive electrode OCP correction at stoichiometry 0.5 [V]"
    own = preset_space("Chen2020", "cell")[name]
    assert (own.initial, own.deviation, own.prior, own.unit) == (0.0, 0.03, True, "V")
    given = resolve_space("Chen2020", {name: {"deviation": 0.01}, "Separator porosity": {"factors": [0.8, 1.2]}})
    assert (given[name].deviation, given[name].upper) == (0.01, own.upper)
    assert not given["Separator porosity"].prior


def test_contact_resistance_needs_its_option_and_scales_with_the_cell() -> None:
    assert "Contact resistance [Ohm]" not in preset_space("Chen2020", "cell")
    options = {"contact resistance": "true"}
    own = preset_space("Chen2020", "cell", options=options)["Contact resistance [Ohm]"]
    half = preset_space("Chen2020", "cell", {"Electrode width [m]": 0.79}, options)["Contact resistance [Ohm]"]
    assert own.upper == pytest.approx(0.04)
    assert half.upper == pytest.approx(2 * own.upper)


def test_sei_parameters_follow_the_mechanism() -> None:
    reaction = preset_space("Chen2020", "sei", options={"SEI": "reaction limited"})
    diffusion = preset_space("Chen2020", "sei", options={"SEI": ("solvent-diffusion limited", "none")})
    assert "SEI reaction exchange current density [A.m-2]" in reaction
    assert "SEI solvent diffusivity [m2.s-1]" not in reaction
    assert "SEI solvent diffusivity [m2.s-1]" in diffusion


def test_a_preset_whose_effect_is_off_is_refused() -> None:
    with pytest.raises(BsaError, match="takes part"):
        preset_space("Chen2020", "sei")


@pytest.mark.parametrize(
    ("call", "meant"),
    [
        (lambda: preset_space("Chen2020", "geometri"), "geometry"),
        (lambda: preset_space("Chen202", "geometry"), "Chen2020"),
        (lambda: resolve_space("Chen2020", {"Negative particle radus [m]": [1e-6, 1e-5]}), "Negative particle radius"),
        (lambda: resolve_space("Chen2020", {"Separator thickness [m]": {"uper": 1}}), "upper"),
        (lambda: resolve_space("Chen2020", {"Electrolyte conductivity [S.m-1]": [0.1, 2]}), "factor"),
    ],
)
def test_mistakes_name_what_was_meant(call, meant: str) -> None:
    with pytest.raises(BsaError) as caught:
        call()
    assert meant in caught.value.hint


def test_what_a_person_writes(tmp_path: Path) -> None:
    file = tmp_path / "space.yaml"
    file.write_text(
        '"Separator thickness [m]": {factors: [0.5, 2]}\n'
        '"Negative electrode porosity": {initial: 0.3, lower: 0.2, upper: 0.5}\n'
        '"Positive electrode porosity": [0.1, 0.6]\n'
        '"Positive particle radius [m]":\n'
        '"Electrolyte conductivity [S.m-1] factor": {factors: [0.5, 2]}\n'
    )
    space = resolve_space("Chen2020", str(file))
    assert len(space) == 5
    assert space["Separator thickness [m]"].scale == "log"
    assert space["Negative electrode porosity"].initial == 0.3
    assert space["Positive particle radius [m]"].upper == pytest.approx(4 * 5.22e-6)
    assert space["Electrolyte conductivity [S.m-1] factor"].initial == 1.0


def test_bounds_without_a_known_range_must_be_given() -> None:
    with pytest.raises(BsaError, match="no bounds"):
        resolve_space("Chen2020", {"Electrode height [m]": None})


COOLING = "Total heat transfer coefficient [W.m-2.K-1]"


def test_a_preset_leaves_out_what_is_0_in_the_set_where_it_searches_multiples() -> None:
    lumped = {"thermal": "lumped"}
    assert COOLING in preset_space("Chen2020", "cell", options=lumped)
    space = preset_space("Chen2020", "cell", {COOLING: 0.0}, lumped)
    assert COOLING not in space
    assert "Cell volume [m3]" in space
    with pytest.raises(BsaError, match="is 0 in Chen2020"):
        resolve_space("Chen2020", {COOLING: None}, {COOLING: 0.0}, lumped)


RADIUS = "Negative particle radius [m]"


@pytest.mark.parametrize(
    ("written", "said"),
    [
        (f'"{RADIUS}": 5', f'"{RADIUS}": 5: keys with values were expected'),
        (f'"{RADIUS}": [1, 2, 3]', "keys with values were expected"),
        (f'"{RADIUS}": {{factors: [0.5, 2, 3]}}', '"factors" is [0.5, 2, 3]: a list should have at most 2 entries'),
        (f'"{RADIUS}": {{lower: 1}}', "lower and upper go together"),
        (f'"{RADIUS}": {{lowr: 1}}', 'did you mean "lower"?'),
        (f'"{RADIUS}": {{lower: 1e-6, upper: 1e-5, scale: logg}}', "'linear' or 'log'"),
        ("{}", "holds no search space"),
    ],
)
def test_a_mistake_in_a_search_file_is_told_by_its_key(written: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "search.yaml"
    file.write_text(written)
    with pytest.raises(BsaError) as caught:
        resolve_space("Chen2020", str(file))
    assert said in str(caught.value)
    assert not any(word in str(caught.value) for word in ("OwnRange", "Tuple", "dictionary", "instance"))


@pytest.mark.parametrize(
    ("options", "searched"),
    [
        ({"SEI": "ec reaction limited"}, {"SEI kinetic rate constant [m.s-1]", "EC diffusivity [m2.s-1]"}),
        ({"lithium plating": "irreversible"}, {"Exchange-current density for plating [A.m-2] factor"}),
        (
            {"loss of active material": ("stress-driven", "none")},
            {"Negative electrode LAM constant proportional term [s-1]"},
        ),
        ({"loss of active material": "reaction-driven"}, {"Negative electrode reaction-driven LAM factor [m3.mol-1]"}),
        ({"particle mechanics": "swelling and cracking"}, {"Negative electrode cracking rate factor"}),
    ],
)
def test_what_ages_is_searched_where_the_model_has_it(options: dict[str, object], searched: set[str]) -> None:
    # Sets that lack the parameters of plating, cracks and loss of material take them from OKane2022.
    found = preset_space("Chen2020", "ageing", options=options)
    assert searched <= set(found.names)
    nothing_ages = {"SEI": "none", "lithium plating": "none", "loss of active material": "none"}
    with pytest.raises(BsaError, match="takes part"):
        preset_space("Chen2020", "ageing", options=nothing_ages)


def test_every_parameter_that_ages_a_cell_has_a_rule() -> None:
    from bsa.core.cell import CELL

    ruled = tuple(str(rule["parameter"]) for rule in CELL.rules)
    assert all(name in ruled for name in presets()["ageing"].parameters)


def test_a_pulsed_cell_adds_the_pores_of_both_electrodes_to_a_cell() -> None:
    usual, pulsed = (preset_space("Chen2020", preset) for preset in ("cell", "pulsed-cell"))
    pores = [p for p in pulsed if p.name not in usual.names]
    assert [p.name for p in pores] == [
        f"{which} electrode Bruggeman coefficient (electrolyte)" for which in ("Negative", "Positive")
    ]
    assert all(p.initial == 1.5 and p.prior for p in pores)
    assert set(usual.names) < set(pulsed.names)
