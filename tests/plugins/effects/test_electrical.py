from types import SimpleNamespace

import numpy as np
import pybamm
import pytest
from bsa.core.effect import Effect
from bsa.core.segmentation import segment
from bsa.core.task import CellModel
from bsa.core.trajectory import StepKind, Trajectory
from bsa.plugins.effects.electrical import double_layer_capacitance, resistive_reactant
from bsa.plugins.pybamm.solving.driven_cell import DrivenCell


@pytest.mark.slow
def test_a_double_layer_of_no_capacitance_can_be_simulated_behind_a_drive():
    levels = np.repeat(np.random.default_rng(0).choice([0.0, 0.2, 0.45, 0.8, 1.2, -0.3], 10), 10)
    drive = np.convolve(np.append(levels, [0.0, 0.0]), np.ones(3) / 3, mode="valid")
    time = np.concatenate([np.arange(100.0), 99.0 + np.arange(0.0, 900.0, 14.5)])
    current = np.append(drive, np.zeros(len(time) - len(drive)))
    record = segment(Trajectory(time, current, np.full(len(time), 3.9), None))
    assert [step.kind for step in record.steps] == [StepKind.DRIVE, StepKind.REST]
    effect = double_layer_capacitance
    cell = DrivenCell(CellModel(parameter_set="Marquis2019", model="SPMe"), (effect,), record, {})
    null, probe = (
        cell.solve({effect.full_name(effect.strength): size}, time, current, 0.8)
        for size in (effect.strength.null, effect.strength.probe)
    )
    assert null is not None
    assert probe is not None
    assert np.abs(probe.voltage - null.voltage)[-1] < 1e-4 < np.max(np.abs(probe.voltage - null.voltage))


BY_ELECTRODE = {effect.variant.split()[0]: effect for effect in resistive_reactant}


def of_a_resistive_reactant(effect: Effect, stoichiometry: float, current: float) -> float:
    """What the effect adds to the voltage of a cell of 2 A.h, V."""
    (which,) = (name for name, one in BY_ELECTRODE.items() if one is effect)
    variables = {
        "Current [A]": pybamm.Scalar(current),
        f"Average {which} particle stoichiometry": pybamm.Scalar(stoichiometry),
    }
    model = SimpleNamespace(variables=variables, param=SimpleNamespace(Q=pybamm.Scalar(2.0)))
    return float(effect.physics.voltage(model, {"overpotential": 0.01}).evaluate())


@pytest.mark.parametrize("share", [0.9, 0.5, 0.1])
@pytest.mark.parametrize("current", [0.1, 4.0])
def test_the_resistance_is_that_of_the_particles_that_have_not_reacted(share: float, current: float) -> None:
    # A thousand particles of evenly distributed conductances, of which the best connected have reacted.
    conductances = (np.arange(1000) + 0.5) / 1000
    left = conductances[: round(1000 * share)]
    expected = -0.01 * current / 2.0 * (np.sum(conductances) / np.sum(left) - 1)
    for which, empties_on in (("negative", 1), ("positive", -1)):
        effect = BY_ELECTRODE[which]
        assert of_a_resistive_reactant(effect, share, empties_on * current) == pytest.approx(
            empties_on * expected, rel=1e-3
        )
        assert of_a_resistive_reactant(effect, 1 - share, -empties_on * current) == pytest.approx(
            -empties_on * expected, rel=1e-3
        )


def test_an_electrode_that_has_run_out_of_particles_has_a_finite_resistance() -> None:
    for stoichiometry in (0.0, -1e-3):
        assert -1e5 < of_a_resistive_reactant(BY_ELECTRODE["negative"], stoichiometry, 2.0) < -1e3
    assert of_a_resistive_reactant(BY_ELECTRODE["negative"], 0.0, 0.0) == 0.0


@pytest.mark.slow
def test_a_resistive_reactant_softens_the_end_of_a_discharge_in_proportion_to_the_current() -> None:
    effect = BY_ELECTRODE["negative"]
    name = effect.full_name(effect.strength)
    losses = []
    for rate in (0.25, 0.5):
        hours = 0.9 / rate
        time = np.linspace(0.0, 3600 * hours, 200)
        current = np.full(200, 5.0 * rate)
        record = segment(Trajectory(time, current, np.full(200, 3.7), None))
        cell = DrivenCell(CellModel(parameter_set="Chen2020", model="SPM"), (effect,), record, {})
        plain, reactant = (cell.solve({name: size}, time, current, 1.0) for size in (0.0, 0.005))
        assert plain is not None
        assert reactant is not None
        losses.append(plain.voltage - reactant.voltage)
    assert losses[1] == pytest.approx(2 * losses[0], rel=0.05, abs=2e-4)
    assert losses[1][-2] > 10 * losses[1][100] > 1e-3
