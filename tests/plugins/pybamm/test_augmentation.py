"""A cell model that has effects of the catalogue: every way to simulate it has them, with their values."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from bsa.core.encoding import decode_task, encode_task
from bsa.core.errors import BsaError
from bsa.core.parameters import ParameterSpace
from bsa.core.target import change_of
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import FloatArray, Step, StepKind, Trajectory
from bsa.experiments.api.scripts import namespace_of
from bsa.plugins.pybamm.augmentation import effects_in
from bsa.plugins.pybamm.export.calibrated_script import script
from bsa.plugins.pybamm.solving.equilibrium import EquilibriumCell
from bsa.plugins.pybamm.solving.experiment_kinds import compiled, solve_reference

HYSTERESIS = CellModel("Chen2020", "SPM", effects=("ocp-hysteresis",))
GAP, DECAY = "ocp-hysteresis: half_gap [V]", "ocp-hysteresis: decay"


def there_and_back() -> Trajectory:
    """Two hours of discharge at C/10, an hour of rest, two hours of charge."""
    time = np.linspace(0.0, 18000.0, 301)
    current = np.where(time < 7200.0, 0.5, np.where(time <= 10800.0, 0.0, -0.5))
    kinds = (StepKind.CC_DISCHARGE, StepKind.REST, StepKind.CC_CHARGE)
    edges = [int(place) for place in (0, np.argmax(current <= 0), np.argmax(current < 0), 301)]
    steps = tuple(Step(kind, edges[n], edges[n + 1], position=n) for n, kind in enumerate(kinds))
    return Trajectory(time, current, np.full(301, 3.7), None, steps)


@pytest.fixture(scope="module")
def task() -> Task:
    (effect,) = effects_in(HYSTERESIS)
    experiment = Experiment("slow", there_and_back(), initial_soc=0.8)
    return Task("hysteresis", HYSTERESIS, ParameterSpace(effect.searched), (experiment,))


def added(task: Task, simulate) -> FloatArray:
    """What 20 mV of hysteresis add to the voltage, by one way to simulate."""
    without, with_it = (simulate({GAP: gap, DECAY: 50.0}).trajectory for gap in (0.0, 0.02))
    assert without is not None
    assert with_it is not None
    return np.asarray(with_it.voltage - without.voltage)


@pytest.mark.slow
def test_search_final_score_and_equilibrium_have_the_effect_alike(task: Task) -> None:
    (experiment,) = task.experiments
    searched = compiled(task.cell, experiment, task.space.targets)
    equilibrium = EquilibriumCell(task)

    def exact(candidate):
        return solve_reference(task.cell, experiment, change_of(task.space.targets, candidate))

    ways = [searched.solve, exact, lambda candidate: equilibrium.outcome(candidate).runs[0]]
    by_search, by_score, at_rest = (added(task, way) for way in ways)
    record = experiment.target
    rest = (record.time > 7300.0) & (record.time < 10700.0)
    assert by_search[rest] == pytest.approx(-0.02, abs=1e-4)  # it stays at rest
    assert by_search[-1] == pytest.approx(0.02, abs=1e-4)
    inner = np.ones(len(record), dtype=bool)
    inner[[step.start for step in record.steps]] = False  # on which side of a jump a sample lies is a convention
    assert np.max(np.abs(by_score - by_search)[inner]) < 3e-4
    assert np.max(np.abs(at_rest - by_search)[inner]) < 3e-4


@pytest.mark.slow
def test_the_script_has_the_effect(task: Task) -> None:
    candidate = {GAP: 0.02, DECAY: 50.0}
    made = namespace_of(script(task, candidate), "script")
    (experiment,) = task.experiments
    score = solve_reference(task.cell, experiment, change_of(task.space.targets, candidate)).trajectory
    assert score is not None
    solution = made["simulate"](0)
    shown = np.interp(score.time, solution["Time [s]"].entries, solution["Voltage [V]"].entries)
    inner = np.ones(len(score), dtype=bool)
    inner[[step.start for step in score.steps]] = False
    assert np.max(np.abs(shown - score.voltage)[inner]) < 2e-4


def test_a_journal_keeps_the_effects_and_leaves_out_that_there_are_none(task: Task) -> None:
    again = decode_task(json.loads(json.dumps(encode_task(task))))
    assert again.cell == task.cell
    assert again.space == task.space
    assert "effects" not in encode_task(replace(task, cell=CellModel("Chen2020", "SPM")))["cell"]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("ocp-hysteresys", 'no effect "ocp-hysteresys"'),
        ("voltage-offset", "one of the instrument"),
        ("sei-growth", "has variants: sei-growth"),
    ],
)
def test_an_effect_that_a_cell_cannot_have_is_refused(name: str, said: str) -> None:
    with pytest.raises(BsaError, match=said):
        effects_in(CellModel("Chen2020", "SPM", effects=(name,)))


def test_two_variants_of_one_effect_are_refused_together() -> None:
    both = ("ocp-shape.negative-electrode", "ocp-shape.positive-electrode")
    with pytest.raises(BsaError, match="variants of one effect"):
        effects_in(CellModel("Chen2020", "SPM", effects=both))
