"""What is said of a misfit that parameters cannot remove."""

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest
from bsa.core.feedback import Feedback
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.task import CellModel, Experiment, Protocol, Task
from bsa.core.trajectory import FloatArray, Step, StepKind, Trajectory
from bsa.core.trial import Trial
from bsa.experiments.misfit_notes import discovery_notes, misfit_notes, potentials_note

SPACE = ParameterSpace((Parameter("Negative particle radius [m]", 5e-6, 1e-6, 2e-5, "log"),))


def record(rest_s: float, slow_v: float, clock: float = 0.0, before: StepKind = StepKind.CC_DISCHARGE) -> Trajectory:
    """Half an hour under load, and a rest in which the voltage rises quickly by 0.3 V and slowly by ``slow_v``."""
    load = np.linspace(0.0, 1800.0, 50)
    rest = np.linspace(0.0, rest_s, 90)
    voltage = np.concatenate(
        [np.full(50, 2.5), 2.5 + 0.3 * (1 - np.exp(-rest / 60)) + slow_v * (1 - np.exp(-rest / 4000))]
    )
    steps = (Step(before, 0, 50), Step(StepKind.REST, 50, 140))
    time = clock + np.concatenate([load, 1800.0 + rest])
    return Trajectory(time, np.repeat([1.0, 0.0], [50, 90]), voltage, None, steps)


def told(
    measured: Trajectory,
    simulated: Trajectory | None,
    residuals: FloatArray | None = None,
    effects: tuple[str, ...] = (),
    protocol: Protocol | None = None,
    offered: Sequence[str] = (),
) -> list[str]:
    cell = CellModel("Chen2020", effects=effects)
    task = Task("cell", cell, SPACE, (Experiment("cell", measured, protocol),))
    best = Trial(0, "initial", 0, SPACE.initial, None, None, residuals, Feedback(), (simulated,), 1.0)
    return misfit_notes(task, best, "bsa discover --data cell.csv", offered)


def test_a_rest_that_the_model_ends_too_early_names_what_to_try() -> None:
    (said,) = told(record(7200.0, 0.2, clock=0.2), record(7200.0, 0.0))
    assert "by 134 mV more than the simulated one" in said
    assert said.endswith("--effect slow-active-material.negative-electrode")


@pytest.mark.parametrize(
    ("measured", "simulated", "effects"),
    [
        (record(7200.0, 0.2), record(7200.0, 0.2), ()),
        (record(7200.0, 0.2), record(7200.0, 0.0), ("slow-active-material.negative-electrode",)),
        (record(7200.0, 0.2), None, ()),
        (record(900.0, 0.2), record(900.0, 0.0), ()),
        (record(7200.0, 0.2, before=StepKind.CC_CHARGE), record(7200.0, 0.0, before=StepKind.CC_CHARGE), ()),
        (record(7200.0, 0.0), record(7200.0, 0.2), ()),
    ],
    ids=["followed", "in the model", "not simulated", "short", "behind a charge", "the other way"],
)
def test_other_rests_say_nothing(measured: Trajectory, simulated: Trajectory | None, effects: tuple[str, ...]) -> None:
    assert told(measured, simulated, effects=effects) == []


def test_a_discovery_names_an_effect_that_it_did_not_consider() -> None:
    measured, simulated = record(7200.0, 0.2, clock=5.0), record(7200.0, 0.0, clock=5.0)
    seen = SimpleNamespace(measured_record=SimpleNamespace(record=measured), time=measured.time)
    errors = [measured.voltage - simulated.voltage]
    (said,) = discovery_notes([seen], errors, {"contact-resistance"})
    assert "by 134 mV more than the simulated one" in said
    assert "--effect slow-active-material" in said
    assert discovery_notes([seen], errors, {"slow-active-material"}) == []
    assert discovery_notes([seen], [0.0 * errors[0]], {"contact-resistance"}) == []


def test_a_misfit_that_follows_the_curve_points_to_a_discovery() -> None:
    wave = 10.0 * np.sin(np.linspace(0.0, 20.0, 200))
    said, to_try = told(record(900.0, 0.0), record(900.0, 0.0), wave)
    assert "follows the curve" in said
    assert said.endswith("bsa discover --data cell.csv")
    assert to_try.endswith("To fit with it: --effect slow-active-material.negative-electrode")
    slow = ("slow-active-material.negative-electrode",)
    assert len(told(record(900.0, 0.0), record(900.0, 0.0), wave, slow)) == 1
    assert len(told(record(900.0, 0.0), record(900.0, 0.0), wave, protocol=(("Discharge at 1C until 2.5 V",),))) == 1
    noise = np.random.default_rng(1).normal(size=200)
    assert told(record(900.0, 0.0), record(900.0, 0.0), noise) == []


PULSE = Trajectory(np.linspace(0.0, 10.0, 20), np.ones(20), np.full(20, 3.5), None, (Step(StepKind.PULSE, 0, 20),))
CONTACT = Parameter("Contact resistance [Ohm]", 0.01, 0.0, 0.1)
PORES = Parameter("Negative electrode Bruggeman coefficient (electrolyte)", 1.5, 1.0, 4.0)


def test_an_effect_that_the_search_might_add_is_not_advised() -> None:
    offered = ["slow-active-material.negative-electrode"]
    assert told(record(7200.0, 0.2), record(7200.0, 0.0), offered=offered) == []


@pytest.mark.parametrize(
    ("measured", "searched", "ohm", "said"),
    [
        (PULSE, (CONTACT,), 0.0, True),
        (PULSE, (CONTACT,), 0.002, False),
        (PULSE, (CONTACT, PORES), 0.0, False),
        (PULSE, (PORES,), 0.0, False),
        (record(900.0, 0.0), (CONTACT,), 0.0, False),
    ],
    ids=["at its bound", "above it", "pores are searched", "contacts are not", "no pulse"],
)
def test_pulses_that_leave_nothing_to_the_contacts_name_the_pores(
    measured: Trajectory, searched: tuple[Parameter, ...], ohm: float, said: bool
) -> None:
    space = ParameterSpace(searched)
    task = Task("cell", CellModel("Chen2020"), space, (Experiment("cell", measured),))
    candidate = {**space.initial, "Contact resistance [Ohm]": ohm}
    best = Trial(0, "initial", 0, candidate, None, None, None, Feedback(), (None,), 1.0)
    notes = misfit_notes(task, best, "bsa discover --data cell.csv")
    assert [note.endswith("--search pulsed-cell") for note in notes] == [True] * said


def test_what_a_published_cell_leaves_may_be_its_potentials():
    assert "bsa-run --data FILE... --parameters 'my cell.json' --scaffold staged" in potentials_note("my cell.json")
