"""What models of a cell have told before a fit is kept in the journal of a discovery."""

import math
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest
from bsa.core.contracts.requests import MeasuredRecord
from bsa.core.inference.problem import Problem
from bsa.core.run.journal import Journal, OpenJournal, read_events
from bsa.core.task import CellModel
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments import discovery_setup
from bsa.experiments.discovery_case import Case, DiscoverOptions
from bsa.experiments.discovery_setup import set_up
from bsa.plugins.pybamm.before_search.radial_mesh import RadialMesh

MESH = RadialMesh(80, math.inf)
SPREADS = {"Separator porosity factor": (0.1, 0.5, 2.0)}


def test_what_was_settled_is_not_found_out_again(tmp_path, monkeypatch):
    time = np.arange(0.0, 1201.0, 30.0)
    steps = (Step(StepKind.CC_DISCHARGE, 0, len(time), 1),)
    record = Trajectory(time, np.full(len(time), 1.0), 4.0 - 1e-4 * time, None, steps)
    case = Case(CellModel("Chen2020", "SPM"), (MeasuredRecord("a", record, 298.15),))
    options = DiscoverOptions(data=["a.csv"], parameters="Chen2020", model="SPM", out=tmp_path / "out")
    asked = []
    monkeypatch.setattr(discovery_setup, "radial_mesh", lambda *_: asked.append("mesh") or MESH)
    monkeypatch.setattr(discovery_setup, "spreads_of", lambda *_: asked.append("spreads") or SPREADS)
    with closing(Journal(options.out)) as file:
        first = set_up(case, options, journal=OpenJournal(file, []))
        events = list(read_events(options.out))
        again = set_up(case, options, journal=OpenJournal(file, events))
        assert asked == ["spreads", "mesh"]
        assert (again.mesh, again.space, again.notes) == (first.mesh, first.space, first.notes)
        assert list(read_events(options.out)) == events
    assert again.mesh == MESH
    assert "80 mesh points resolve each particle" in again.notes[0]


def test_an_effect_of_the_run_is_in_the_base_model_and_no_candidate_any_more(tmp_path, monkeypatch):
    time = np.arange(0.0, 1201.0, 30.0)
    steps = (Step(StepKind.CC_DISCHARGE, 0, len(time), 1),)
    record = Trajectory(time, np.full(len(time), 1.0), 4.0 - 1e-4 * time, None, steps)
    cell = CellModel("Chen2020", "SPM", effects=("ocp-hysteresis",))
    name = "ocp-hysteresis: half_gap [V]"
    case = Case(cell, (MeasuredRecord("a", record, 298.15),), strengths={name: 0.02})
    options = DiscoverOptions(data=["a.csv"], parameters="Chen2020", model="SPM", out=tmp_path / "out")
    monkeypatch.setattr(discovery_setup, "radial_mesh", lambda *_: MESH)
    found = set_up(case, options)
    assert found.space[name].initial == 0.02
    assert found.space[name].prior
    assert "ocp-hysteresis" not in {effect.name for effect in found.catalogue}
    start = found.space.at(np.zeros(len(found.space)))
    base, without = (found.problem.predict((), {**start, **more}) for more in ({}, {name: 0.0}))
    # A fifteenth of the capacity has passed, of which a twentieth brings the hysteresis to 1/e of its end.
    grown = 1.0 - math.exp(-20.0 / 15.0)
    assert without[0].voltage[-1] - base[0].voltage[-1] == pytest.approx(0.02 * grown, rel=0.02)


def test_the_discrepancy_is_worded_with_the_noise_of_all_records_as_in_the_report(monkeypatch):
    problem = SimpleNamespace(
        observations=[SimpleNamespace(noise=1e-3)], noise_v=4e-3, predict=lambda *_: [], errors=lambda predictions: []
    )
    monkeypatch.setattr(discovery_setup, "localise", lambda *_: [])
    monkeypatch.setattr(discovery_setup, "in_words", lambda places, noise_v: [f"{noise_v:g}"])
    base = SimpleNamespace(fit=SimpleNamespace(candidate={}))
    setup = SimpleNamespace(problem=problem, capacity_ah=1.0)
    assert discovery_setup.DiscoverySetup.discrepancy(setup, base) == ["0.004"]


def test_what_the_model_lacks_of_a_reference_is_taken_off_and_said(tmp_path, monkeypatch):
    time = np.arange(0.0, 1201.0, 30.0)
    steps = (Step(StepKind.CC_DISCHARGE, 0, len(time), 1),)
    record = Trajectory(time, np.full(len(time), 1.0), 4.0 - 1e-4 * time, None, steps)
    later, earlier = (MeasuredRecord(name, record, 298.15) for name in ("later", "earlier"))
    case = Case(CellModel("Chen2020", "SPM"), (later,), references=(earlier,), known_v=5e-3)
    options = DiscoverOptions(data=["a.csv"], parameters="Chen2020", model="SPM", out=tmp_path / "out")
    monkeypatch.setattr(discovery_setup, "radial_mesh", lambda *_: MESH)
    said = []
    found = set_up(case, options, said.append)
    (note,) = (text for text in found.notes if "taken off" in text)
    assert "later: what the base model lacks of earlier" in note
    assert f"note: {note}" in said
    assert found.engine().settings.known_v == 0.0
    seen = found.problem.observations
    start = found.space.at(np.zeros(len(found.space)))
    (*_, (_, error)) = Problem(found.simulator, seen, seen).held_out((), start)
    assert np.max(np.abs(error)) < 1e-3
