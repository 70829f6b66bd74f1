"""To which tasks effects are offered."""

import json
from dataclasses import replace
from typing import Any

import pytest
from bsa.core.encoding import decode_task, encode_task
from bsa.core.errors import BsaError
from bsa.core.offered_effects import absent_effects
from bsa.core.scaffold import Scaffold, load_scaffold
from bsa.plugins.pybamm.before_search.offered_effects import with_offered
from bsa.testing.sample_task import sample_task

SLOW = "slow-active-material.negative-electrode"
REACTANT = "resistive-reactant.negative-electrode"
OVERPOTENTIAL = "resistive-reactant: overpotential [V]"
NAMES = ("slow-active-material: share", "slow-active-material: time [s]", "slow-active-material: reference_lag")


def measured(**cell: Any) -> Any:
    """A task of a measured current, some of whose parameters have a prior."""
    task = sample_task()
    first, *others = task.space
    space = type(task.space)((replace(first, deviation=0.1, prior=True), *others))
    return replace(task, space=space, cell=replace(task.cell, **cell))


def by_protocol() -> Any:
    task = measured()
    steps = (("Rest for 1 minute", "Discharge at 2 A for 10 minutes", "Rest for 4 minutes"),)
    return replace(task, experiments=(replace(task.experiments[0], protocol=steps),))


def offers(**changes: Any) -> Scaffold:
    return load_scaffold("staged").model_copy(update=changes)


def test_a_fit_of_measured_currents_is_offered_effects_and_begins_without_them() -> None:
    task = with_offered(measured(), offers())
    assert task.cell.effects == (REACTANT, SLOW)
    assert dict(task.cell.offered) == {REACTANT: (OVERPOTENTIAL,), SLOW: NAMES}
    assert task.space.names[-4:] == (OVERPOTENTIAL, *NAMES)
    assert absent_effects(task, task.space.initial) == (REACTANT, SLOW)
    assert decode_task(json.loads(json.dumps(encode_task(task)))).cell == task.cell
    # A run that goes on has its task from the journal.
    assert with_offered(task, offers()) is task


@pytest.mark.parametrize(
    "task",
    [
        pytest.param(by_protocol(), id="protocol"),
        pytest.param(sample_task(), id="no prior"),
        pytest.param(
            measured(effects=("slow-active-material.positive-electrode", "resistive-reactant.positive-electrode")),
            id="has variants of them",
        ),
        pytest.param(measured(options={"working electrode": "positive"}), id="half cell"),
        pytest.param(measured(options={"particle phases": ("2", "1")}), id="composite"),
    ],
)
def test_others_are_not(task: Any) -> None:
    assert with_offered(task, offers()) is task


def test_only_a_scaffold_that_offers_it_on_pybamm_does() -> None:
    task = measured()
    assert with_offered(task, offers(offers=[])) is task
    assert with_offered(task, load_scaffold("hybrid")) is task
    other = load_scaffold("staged").simulator.model_copy(update={"use": "toy-cell"})
    assert with_offered(task, offers(simulator=other)) is task
    with pytest.raises(BsaError, match='no effect "slow-materiel"'):
        with_offered(task, offers(offers=["slow-materiel"]))
    composite = measured(options={"particle phases": ("1", "2")})
    assert with_offered(composite, offers()).cell.effects == (REACTANT, SLOW)
