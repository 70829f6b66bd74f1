"""Measured cells: a right name or no name, never a wrong one. Slow: minutes each."""

from pathlib import Path

import numpy as np
import pybamm
import pytest
from bsa.experiments.discover import discover
from bsa.experiments.discovery_case import DiscoverOptions, read_case

DATA = Path(__file__).parents[2].parent / "shared" / "data"
NASA, LGM50 = DATA / "nasa_pcoe", DATA / "lgm50"


@pytest.fixture(scope="module", autouse=True)
def _simulated_here() -> None:
    """These simulate for minutes: in worker processes, as the command does."""


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not NASA.exists(), reason="../shared/data/nasa_pcoe is absent")
@pytest.mark.parametrize("search", ["all", "capacity"])
def test_nasa_b0005_lacks_a_series_resistance(tmp_path, search):
    def discharge(test):
        return {"path": NASA / "B0005_discharges.csv.gz", "read": {"where": {"test_id": test}}}

    charge = {"path": NASA / "B0005_charges_every20th.csv.gz", "read": {"where": {"test_id": "2"}}}
    options = DiscoverOptions(
        data=[discharge("1"), charge],
        holdout=[discharge("5")],
        parameters="Ai2020",
        model="SPMe",
        ambient_c=24.0,
        search=search,
        max_effects=1,
        out=tmp_path,
    )
    found = discover(options, workers=2)
    assert found.verdict != "no-missing-effect"
    if found.verdict == "effect-found":
        assert found.names == ("contact-resistance",)
    if search == "capacity":
        # As large as the cell's own impedance, which no fit saw; hysteresis comes as near to these records.
        assert found.verdict in ("effect-found", "ambiguous")
        assert found.names == ("contact-resistance",)
        assert 0.044 < found.findings.best.estimates["contact-resistance"][0].value < 0.064
        assert found.gap["holdout_closed"] > 0.75


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not LGM50.exists(), reason="../shared/data/lgm50 is absent")
def test_lgm50_lacks_self_heating(tmp_path):
    """At 2C and 0.5C together, which a bent isothermal model cannot follow both; the temperature is shown to no fit."""
    options = DiscoverOptions(
        data=[LGM50 / "Cell796_2C_25degC.csv", LGM50 / "Cell785_0p5C_25degC.csv"],
        holdout=[LGM50 / "Cell783_0p1C_25degC.csv"],
        parameters="ORegan2022",
        model="SPMe",
        ambient_c=25.0,
        max_effects=1,
        effects=["self-heating"],  # the whole catalogue takes half an hour, and all base parameters twice as long
        search="capacity",
        out=tmp_path,
    )
    found = discover(options, workers=2)
    assert any("mesh points resolve each particle" in note for note in found.notes)
    assert found.names in ((), ("self-heating",))  # the right name or none
    if not found.names:
        assert found.verdict == "unexplained"
        return
    best = found.findings.best
    assert best.temperature_rms_k < 4.0 < found.findings.base.temperature_rms_k
    assert best.rmse_v < found.findings.base.rmse_v


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not LGM50.exists(), reason="../shared/data/lgm50 is absent")
def test_heat_is_not_all_that_the_lgm50_at_2c_lacks(tmp_path):
    """With nothing fitted and the measured temperature imposed, a resolved ORegan2022 is farther off than without."""
    options = DiscoverOptions(
        data=[LGM50 / "Cell796_2C_25degC.csv"], parameters="ORegan2022", model="SPMe", ambient_c=25.0, out=tmp_path
    )
    record = read_case(options).measured_records[0].record
    drawn = np.flatnonzero(record.current > 5.0)
    part = slice(drawn[0], drawn[-1] + 1)
    time = record.time[part] - record.time[drawn[0]]
    time, kept = np.unique(time, return_index=True)
    voltage, kelvin = record.voltage[part][kept], record.temperature[part][kept]

    def discharged(imposed: bool) -> tuple[float, np.ndarray]:
        """When the cell is empty, s, and what was measured above it in the first 85 % of that time, V."""
        values = pybamm.ParameterValues("ORegan2022")
        values.update({"Current function [A]": 10.0, "Lower voltage cut-off [V]": 0.8})
        if imposed:
            values["Ambient temperature [K]"] = lambda y, z, t: pybamm.Interpolant(time, kelvin, t)
        model = pybamm.lithium_ion.SPMe({"thermal": "isothermal"})
        points = {**model.default_var_pts, "r_n": 80, "r_p": 80}
        solver = pybamm.IDAKLUSolver(rtol=1e-6, atol=1e-7)
        simulation = pybamm.Simulation(model, parameter_values=values, var_pts=points, solver=solver)
        solved = simulation.solve([0.0, time[-1]], t_interp=time, initial_soc=0.985)
        simulated = solved["Voltage [V]"].data
        empty = float(np.interp(2.5, simulated[::-1], solved.t[::-1]))
        early = time < 0.85 * empty
        return empty, (voltage - np.interp(time, solved.t, simulated))[early]

    lasts, isothermal = discharged(False)
    lasts_longer, warm = discharged(True)
    assert lasts < lasts_longer < time[-1]
    assert np.sqrt(np.mean(isothermal**2)) == pytest.approx(0.067, abs=0.01)
    assert np.mean(warm) == pytest.approx(-0.121, abs=0.01)
