"""What is hidden is what its name says, by PyBaMM alone."""

import numpy as np
import pybamm
import pytest
from bsa.experiments.discovery_bench.hidden_physics import EFFECTS


@pytest.mark.slow
@pytest.mark.parametrize("parameter_set", ["Chen2020", "ORegan2022"])
def test_hidden_clogging_has_the_salt_gradient_of_narrow_pores(
    parameter_set: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (clogging,) = (effect for effect in EFFECTS if effect.key == "porosity-change")
    share, name = 0.9, "X-averaged positive electrolyte concentration [mol.m-3]"
    base, narrow, clogged = (pybamm.ParameterValues(parameter_set) for _ in range(3))
    for domain in ("Negative electrode", "Separator", "Positive electrode"):
        narrow[f"{domain} porosity"] *= share
    passed = pybamm.Scalar(clogged["Nominal cell capacity [A.h]"])
    with monkeypatch.context() as patch:
        patch.setattr(pybamm, "Variable", lambda name: passed)
        assert clogging.prepare is not None
        clogging.prepare(clogged, -float(np.log(share)), 298.15)
    missing, voltages = [], []
    for values in (base, narrow, clogged):
        values["Current function [A]"] = values["Nominal cell capacity [A.h]"]
        points = dict.fromkeys(("x_n", "x_s", "x_p", "r_n", "r_p"), 10)
        simulation = pybamm.Simulation(pybamm.lithium_ion.SPMe(), parameter_values=values, var_pts=points)
        solution = simulation.solve([0, 200], initial_soc=0.9)
        missing.append(1000.0 - float(solution[name](200.0)))
        voltages.append(float(solution["Voltage [V]"](200.0)))
    # Less salt also slows its diffusion.
    assert missing[1] / missing[0] > 1.09
    assert missing[2] == pytest.approx(missing[1], rel=1e-3)
    assert voltages[2] == pytest.approx(voltages[1], abs=2e-4)
