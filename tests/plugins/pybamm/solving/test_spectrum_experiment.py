"""Spectra of candidates: compiled once, as an independent simulation has them, and acted on by what is searched."""

from dataclasses import replace

import numpy as np
import pybamm
import pytest
from bsa.core.comparison.spectrum_record import recorded_spectrum, spectrum_record
from bsa.core.spectrum import ImpedanceSpectrum
from bsa.core.target import CellChange, change_of
from bsa.core.task import CellModel, Experiment
from bsa.plugins.pybamm.before_search.presets import resolve_space
from bsa.plugins.pybamm.solving.experiment_kinds import compiled, solve_reference
from bsa.plugins.pybamm.solving.spectrum_experiment import SpectrumExperiment

FREQUENCY = np.logspace(3, -2, 11)
CONTACT = "Contact resistance [Ohm]"
EXCHANGE = "Positive electrode exchange-current density [A.m-2] factor"
RADIUS = "Negative particle radius [m]"
CAPACITY = "Negative electrode double-layer capacity [F.m-2]"
CELL = CellModel("Chen2020", "SPM", {"contact resistance": "true"})


def experiment(voltage: float | None = 3.8, soc: float | None = None) -> Experiment:
    spectrum = ImpedanceSpectrum("z.csv", FREQUENCY, np.full(11, 0.02 - 1e-3j))
    return Experiment("z.csv", spectrum_record(spectrum), None, None, 298.15, soc, voltage)


def impedance(run) -> np.ndarray:
    assert run.failure is None
    return recorded_spectrum("z.csv", run.trajectory).impedance


@pytest.mark.slow
def test_what_a_candidate_changes_shows_in_its_impedance() -> None:
    space = resolve_space(
        "Chen2020", {CONTACT: [0.0, 0.1], EXCHANGE: [0.1, 10], RADIUS: {}, CAPACITY: {"factors": [0.5, 2]}}
    )
    simulated = compiled(CELL, experiment(), space.targets)
    assert isinstance(simulated, SpectrumExperiment)
    base = dict(space.initial) | {CONTACT: 0.0}
    plain = impedance(simulated.solve(base))
    assert impedance(simulated.solve({**base, CONTACT: 0.03})) - plain == pytest.approx(0.03)
    # Slow reactions widen the arc: nothing at high frequencies, all of it at low ones.
    further = impedance(simulated.solve({**base, EXCHANGE: 0.3})).real - plain.real
    assert abs(further[0]) < 1e-4
    assert further[-3:] == pytest.approx(further[-1], rel=0.01)
    assert further[-1] > 1e-3
    # What was compiled once is what is built for one candidate alone.
    for name, value in ((RADIUS, 9e-6), (CAPACITY, 0.3)):
        other = {**base, name: value}
        found = impedance(simulated.solve(other))
        assert np.abs(found - plain).max() > 1e-4
        alone = solve_reference(CELL, experiment(), change_of(space.targets, other))
        assert found == pytest.approx(impedance(alone), abs=1e-8)


@pytest.mark.slow
def test_a_spectrum_is_that_of_pybamm_with_resolved_particles_at_the_state_of_charge_of_its_voltage() -> None:
    model = pybamm.lithium_ion.SPM({"surface form": "differential"})
    values = pybamm.ParameterValues("Chen2020")
    points = {**model.default_var_pts, "r_n": 400, "r_p": 400}
    pybamm_alone = pybamm.EISSimulation(model, parameter_values=values, var_pts=points)
    expected = pybamm_alone.solve(FREQUENCY, initial_soc="3.8 V")["Impedance [Ohm]"]
    plain = CellModel("Chen2020", "SPM")
    # 5 % with PyBaMM's 20 uniform points.
    assert impedance(solve_reference(plain, experiment(), CellChange())) == pytest.approx(expected, rel=5e-3)


def test_a_state_of_charge_can_be_given_and_one_that_cannot_be_is_a_failure() -> None:
    given = experiment(None, 0.25)
    assert impedance(solve_reference(CELL, given, CellChange()))[0].real > 0
    run = solve_reference(CELL, experiment(None, 3.0), CellChange())
    assert run.trajectory is None
    assert run.failure is not None
    assert "must lie between 0 and 1" in run.failure.cause


def test_a_spectrum_beside_an_effect_on_the_measured_current_is_that_of_the_cell() -> None:
    leaking = replace(CELL, effects=("self-discharge",))
    plain, leaks = (
        impedance(solve_reference(cell, experiment(), CellChange(effects=own)))
        for cell, own in ((CELL, {}), (leaking, {"self-discharge: leak [A]": 0.1}))
    )
    assert leaks == pytest.approx(plain, abs=1e-9)
