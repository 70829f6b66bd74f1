"""A cell as BPX gives the same curve when it is read back, and what it cannot say is named."""

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.target import CellChange
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import Trajectory
from bsa.plugins.pybamm.before_search.activation_energies import independent_of_temperature, with_activation_energies
from bsa.plugins.pybamm.cells.parameter_files import parsed, read_values
from bsa.plugins.pybamm.cells.parameter_sets import load
from bsa.plugins.pybamm.export.bpx_export import to_bpx
from bsa.plugins.pybamm.solving.experiment_kinds import solve_reference

NOTHING = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
RUN = Experiment("r", NOTHING, (("Discharge at 1C for 20 minutes", "Rest for 5 minutes"),), None, 298.15, 0.9)
CONTACT = {"contact resistance": "true"}


@pytest.mark.slow
def test_the_file_read_back_gives_the_same_curve() -> None:
    cell = CellModel("Chen2020", "SPMe", CONTACT, {"Contact resistance [Ohm]": 0.01})
    factors = {"Negative particle diffusivity [m2.s-1]": 1.3, "Negative electrode OCP [V]": 1.05}
    change = CellChange({"Electrode width [m]": 1.3}, factors, 0.98)
    file = to_bpx(cell, change, RUN, "a cell")
    assert file.left_out == ()
    read_back = replace(cell, parameter_set=parsed("b.json", file.text), overrides={})
    runs = [solve_reference(one, RUN, own) for one, own in ((cell, change), (read_back, CellChange()))]
    ours, theirs = (run.trajectory for run in runs)
    assert ours is not None
    assert theirs is not None
    time = np.linspace(0.0, ours.time[-1], 200)
    difference = np.interp(time, ours.time, ours.voltage) - np.interp(time, theirs.time, theirs.voltage)
    assert np.max(np.abs(difference)) < 2e-4


@pytest.mark.slow
@pytest.mark.parametrize("base", ["OKane2022", "Chen2020"])
def test_the_file_of_a_cell_whose_rates_depend_on_the_temperature_is_right_in_the_cold_too(base: str) -> None:
    own = base if base == "OKane2022" else with_activation_energies(base, independent_of_temperature(base))
    cell = CellModel(own, "SPMe")
    file = to_bpx(cell, CellChange(), RUN, "x")
    energies = [
        value
        for part in file.content["Parameterisation"].values()
        for key, value in part.items()
        if "activation" in key
    ]
    assert len(energies) == 6
    assert all(1e3 < energy < 1e5 for energy in energies)
    read_back = CellModel(parsed("b.json", file.text), "SPMe")
    for kelvin in (298.15, 278.15):
        run = replace(RUN, temperature_k=kelvin)
        ours, theirs = (solve_reference(one, run, CellChange()).trajectory for one in (cell, read_back))
        assert ours is not None
        assert theirs is not None
        time = np.linspace(0.0, ours.time[-1], 200)
        difference = np.interp(time, ours.time, ours.voltage) - np.interp(time, theirs.time, theirs.voltage)
        assert np.max(np.abs(difference)) < 2e-3


def test_a_warm_cell_starts_at_its_own_temperature() -> None:
    run = replace(RUN, temperature_k=298.15, initial_temperature_k=303.15)
    state = to_bpx(CellModel("Chen2020"), CellChange(), run, "x").content["State"]
    assert state["Initial conditions"]["Initial temperature [K]"] == 303.15
    assert state["Thermal environment"]["Ambient temperature [K]"] == 298.15


@pytest.mark.slow
def test_a_thermodynamic_factor_goes_into_the_transference_number() -> None:
    cell = CellModel("Chen2020", "DFN", overrides={"Thermodynamic factor": 2.2})
    file = to_bpx(cell, CellChange(), RUN, "x")
    assert any("no thermodynamic factor (2.2" in text for text in file.left_out)
    ideal = replace(cell, overrides={})
    read_back = replace(cell, parameter_set=parsed("b.json", file.text), overrides={})
    runs = [solve_reference(one, RUN, CellChange()).trajectory for one in (cell, read_back, ideal)]
    assert all(run is not None for run in runs)
    time = np.linspace(0.0, min(run.time[-1] for run in runs if run is not None), 200)
    measured, folded, dropped = (np.interp(time, run.time, run.voltage) for run in runs if run is not None)
    assert np.max(np.abs(folded - measured)) < 0.3 * np.max(np.abs(dropped - measured))


@pytest.mark.slow
def test_a_cell_that_warms_warms_as_much_when_it_is_read_back() -> None:
    cell = CellModel("Chen2020", "SPMe", {"thermal": "lumped"})
    change = CellChange({"Total heat transfer coefficient [W.m-2.K-1]": 37.0, "Cell volume [m3]": 3e-5})
    file = to_bpx(cell, change, RUN, "x")
    assert file.left_out == ()
    read_back = replace(cell, parameter_set=parsed("b.json", file.text))
    ours, theirs = (
        solve_reference(one, RUN, own).trajectory for one, own in ((cell, change), (read_back, CellChange()))
    )
    assert ours is not None
    assert theirs is not None
    assert ours.temperature is not None
    assert theirs.temperature is not None
    assert np.ptp(ours.temperature) > 3.0
    time = np.linspace(0.0, ours.time[-1], 200)
    kelvin = np.interp(time, ours.time, ours.temperature)
    assert np.interp(time, theirs.time, theirs.temperature) == pytest.approx(kelvin, abs=0.02)


@pytest.mark.slow
def test_a_fitted_number_without_a_field_of_its_own_is_kept_and_a_function_is_named() -> None:
    number, function = "Negative electrode double-layer capacity [F.m-2]", "Negative electrode cracking rate"
    file = to_bpx(CellModel("OKane2022"), CellChange({number: 3.3}, {function: 2.0}), RUN, "x")
    assert load(parsed("b.json", file.text))[number] == 3.3
    assert [text for text in file.left_out if number in text and "user-defined" in text]
    assert [text for text in file.left_out if function in text and "not in the file" in text]


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        (CellModel("Ai2020", "DFN"), "Thermodynamic factor is a number in BPX"),
        (CellModel("Chen2020", "DFN", {"SEI": "reaction limited"}), "SEI=reaction limited"),
        (CellModel("Chen2020", "DFN", {"thermal": "x-full"}), "Heat capacities and conductivities of the layers"),
        (CellModel("ORegan2022", "DFN", {"thermal": "lumped"}), "The heat capacity is a number in BPX"),
    ],
)
def test_what_bpx_cannot_say_is_named(cell: CellModel, words: str) -> None:
    assert any(words in text for text in to_bpx(cell, CellChange(), RUN, "x").left_out)


@pytest.mark.parametrize(("soc", "kept"), [(1.052, 1.0), (-0.01, 0.0)])
def test_a_start_beyond_the_limits_is_at_the_limit_and_mentioned(soc: float, kept: float) -> None:
    file = to_bpx(CellModel("Chen2020"), CellChange(), replace(RUN, initial_soc=soc), "x")
    assert file.content["State"]["Initial conditions"]["Initial state-of-charge"] == kept
    (text,) = file.left_out
    assert f"state of charge of {100 * soc:.1f} %" in text


@pytest.mark.slow
def test_a_cell_colder_than_its_reference_starts_at_the_same_voltage() -> None:
    # Mohtat2020 has an entropic change: the potentials of the file are those in the cold, and so are its limits.
    cold = replace(RUN, temperature_k=283.15)
    cell = CellModel("Mohtat2020", "SPM")
    read_back = CellModel(parsed("b.json", to_bpx(cell, CellChange(), cold, "x").text), "SPM")
    ours, theirs = (solve_reference(one, cold, CellChange()).trajectory for one in (cell, read_back))
    assert ours is not None
    assert theirs is not None
    assert theirs.voltage[0] == pytest.approx(ours.voltage[0], abs=5e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Mohtat2020", "Marquis2019"])
def test_a_cell_that_starts_where_its_set_does_starts_there_in_the_file(name: str) -> None:
    # One set starts empty, the other one half charged.
    run = replace(RUN, protocol=(("Charge at C/10 for 1 minute",),), initial_soc=None)
    cell = CellModel(name, "SPM")
    read_back = CellModel(parsed("b.json", to_bpx(cell, CellChange(), run, "x").text), "SPM")
    ours, theirs = (solve_reference(one, run, CellChange()).trajectory for one in (cell, read_back))
    assert ours is not None
    assert theirs is not None
    assert theirs.voltage[0] == pytest.approx(ours.voltage[0], abs=2e-3)


@pytest.mark.slow
def test_a_separator_of_nothing_but_electrolyte_is_read_back() -> None:
    cell = CellModel("Marquis2019", "SPMe")
    assert load("Marquis2019")["Separator porosity"] == 1.0
    values = read_values(parsed("b.json", to_bpx(cell, CellChange(), RUN, "x").text))
    assert values["Separator Bruggeman coefficient (electrolyte)"] == pytest.approx(1.5, abs=1e-6)


def test_a_file_of_a_cell_that_was_fitted_with_another_model_says_so() -> None:
    (said,) = to_bpx(CellModel("Chen2020", "SPM"), CellChange(), RUN, "x").left_out
    assert "fitted with SPM" in said
    assert not to_bpx(CellModel("Chen2020", "DFN"), CellChange(), RUN, "x").left_out
