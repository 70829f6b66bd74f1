import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bsa.core.comparison.signal_metrics import SignalMetrics
from bsa.core.encoding import decode_task, encode_task
from bsa.core.errors import BsaError
from bsa.core.feedback import Feedback
from bsa.core.parameters import ParameterSpace
from bsa.core.record import Record
from bsa.core.target import INITIAL_SOC, CellChange
from bsa.core.task import Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.core.trial import Trial
from bsa.experiments.run_record import RunRecord
from bsa.experiments.task_request import CellChoice, Records, task_of_records
from bsa.experiments.tasks import parameter_source as parameter_source_module
from bsa.experiments.tasks.measured_cell import CellRequest
from bsa.experiments.tasks.parameter_source import found_cell, parameter_source, starts_left_out, with_its_space
from bsa.experiments.tasks.record_request import RecordRequest
from bsa.experiments.tasks.records import build_task
from bsa.plugins.pybamm.augmentation import effects_in
from bsa.plugins.pybamm.cells.parameter_sets import load
from bsa.plugins.pybamm.cells.state_of_charge import InitialState

HALF_GAP = "ocp-hysteresis: half_gap [V]"
SHAPE = "Positive electrode OCP correction at stoichiometry 0.5 [V]"


def at_rest(name: str, voltage: float) -> Record:
    time = np.arange(0.0, 601.0, 60.0)
    steps = (Step(StepKind.REST, 0, 6), Step(StepKind.CC_DISCHARGE, 6, len(time), position=1))
    current = np.where(np.arange(len(time)) < 6, 0.0, 1.0)
    return Record(name, Trajectory(time, current, voltage - 0.02 * current, None, steps))


def task_of(*records: Record) -> Task:
    search = {INITIAL_SOC: {"lower": 0.0, "upper": 1.0}, SHAPE: {"lower": -0.1, "upper": 0.1}}
    return build_task("t", CellRequest("Chen2020", "SPM", search=search), [RecordRequest(one) for one in records])


def finished(task: Task) -> RunRecord:
    best = {name: {INITIAL_SOC: 0.61, SHAPE: 0.08}[name] for name in task.space.names}
    trial = Trial(0, "initial", 0, best, SignalMetrics(1.0, {}), None, np.ones(3), Feedback({}), (), 0.0)
    return RunRecord("run", task, {}, {}, "", "finished", (trial,), (), (), trial)


def test_the_name_of_an_installed_set_is_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "Chen2020").mkdir()
    (tmp_path / "Chen2020" / "journal.jsonl").write_text('{"event":"run"}\n')
    monkeypatch.chdir(tmp_path)
    assert parameter_source("Chen2020") == "Chen2020"
    with pytest.raises(BsaError, match="does not begin with a run"):
        parameter_source("./Chen2020")


@pytest.fixture
def with_hysteresis(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RunRecord:
    """A finished run whose model has an effect, in the folder of the test."""
    asked = CellRequest("Chen2020", "SPM", search={SHAPE: {"lower": -0.1, "upper": 0.1}}, effects=["ocp-hysteresis"])
    task = build_task("t", asked, [RecordRequest(at_rest("a", 3.9))])
    best = {parameter.name: parameter.initial for parameter in task.space} | {SHAPE: 0.08, HALF_GAP: 0.02}
    run = replace(finished(task_of(at_rest("a", 3.9))), task=task)
    metrics = SignalMetrics(1.0, {"voltage_rmse_mv": 6.5})
    trial = replace(run.trials[0], candidate=best, metrics=metrics)
    run = replace(run, trials=(trial,), best=trial)
    monkeypatch.setattr(parameter_source_module, "read_finished", lambda folder: run)
    (tmp_path / "journal.jsonl").touch()
    return run


def test_a_discovery_gets_what_the_model_of_a_run_has_beside_its_parameters(
    tmp_path: Path, with_hysteresis: RunRecord
) -> None:
    assert found_cell("Chen2020") is None
    assert found_cell(str(tmp_path / "set.json")) is None
    found = found_cell(str(tmp_path))
    assert found is not None
    assert found.effects == ("ocp-hysteresis",)
    assert found.left_v == pytest.approx(6.5e-3)
    assert found.strengths[HALF_GAP] == 0.02
    of_effect = {one for one in with_hysteresis.task.space.names if one.startswith("ocp-hysteresis")}
    assert set(found.strengths) == of_effect
    assert found.options == {"contact resistance": "true"}
    assert load(found.parameters)["Nominal cell capacity [A.h]"] == pytest.approx(5.0, rel=0.05)
    with pytest.raises(BsaError, match="has ocp-hysteresis beside its parameters"):
        parameter_source(str(tmp_path))


@pytest.mark.parametrize("how", ["start_from", "parameters"])
def test_what_a_run_found_of_its_effects_stays_where_something_else_is_searched(
    how: str, tmp_path: Path, with_hysteresis: RunRecord
) -> None:
    def after(**more: Any) -> Task:
        run = {"start_from": tmp_path} if how == "start_from" else {"parameters": str(tmp_path)}
        return task_of_records(Records([at_rest("b", 3.8)]), CellChoice(model="SPM", **run, **more))

    task = after(search={SHAPE: {"lower": -0.1, "upper": 0.1}})
    assert task.space.names == (SHAPE,)
    assert task.cell.effects == ("ocp-hysteresis",)
    (effect,) = effects_in(task.cell)
    assert effect.values({})["half_gap"] == 0.02
    assert decode_task(json.loads(json.dumps(encode_task(task)))).cell == task.cell
    # An effect that is named is searched anew.
    again = after(search={SHAPE: {"lower": -0.1, "upper": 0.1}}, effects=["ocp-hysteresis"])
    assert HALF_GAP in again.space
    assert not again.cell.strengths


def test_a_record_that_was_fitted_starts_at_the_state_of_charge_that_was_found() -> None:
    run = finished(task_of(at_rest("a", 3.9)))
    goes_on = with_its_space(task_of(at_rest("a", 3.9)), run).space
    assert {parameter.name: parameter.initial for parameter in goes_on} == {INITIAL_SOC: 0.61, SHAPE: 0.08}


def test_another_record_starts_where_the_fitted_cell_shows_its_voltage() -> None:
    run, task = finished(task_of(at_rest("a", 3.9))), task_of(at_rest("b", 3.8))
    space = with_its_space(task, run).space
    state = InitialState(load("Chen2020"))
    change = CellChange(ocp_shape=space.change({SHAPE: 0.08}).ocp_shape)
    (voltage,) = state.voltages(change, space[INITIAL_SOC].initial, np.zeros(1))
    assert voltage == pytest.approx(3.8, abs=2e-3)
    assert abs(space[INITIAL_SOC].initial - task.space[INITIAL_SOC].initial) > 0.02
    assert with_its_space(task, run, socs_given=True).space[INITIAL_SOC] == task.space[INITIAL_SOC]


def test_what_a_simpler_model_does_not_depend_on_is_left_out_of_an_earlier_runs_search() -> None:
    conductivity = "Electrolyte conductivity [S.m-1] factor"
    search = {conductivity: {"factors": [0.5, 2.0]}, SHAPE: {"lower": -0.1, "upper": 0.1}}
    request = [RecordRequest(at_rest("a", 3.9))]
    earlier = build_task("t", CellRequest("Chen2020", "SPMe", search=search), request)
    best = {conductivity: 1.2, SHAPE: 0.08}
    trial = Trial(0, "initial", 0, best, SignalMetrics(1.0, {}), None, np.ones(3), Feedback({}), (), 0.0)
    run = RunRecord("run", earlier, {}, {}, "", "finished", (trial,), (), (), trial)
    assert with_its_space(earlier, run).space.names == (conductivity, SHAPE)
    simpler = with_its_space(task_of(at_rest("a", 3.9)), run)
    assert SHAPE in simpler.space
    assert conductivity not in simpler.space
    assert any("not searched: Electrolyte conductivity." in note for note in simpler.notes)


def test_a_run_goes_on_with_its_correction_of_the_start_and_another_rest_voltage_gets_its_own() -> None:
    def task_at(voltage: float) -> Task:
        return build_task("t", CellRequest("Chen2020", "SPM"), [RecordRequest(at_rest("a", voltage))])

    first = task_at(3.9)
    correction = "Initial voltage correction at 3.90 V [V]"
    best = {parameter.name: parameter.initial for parameter in first.space} | {correction: 0.013}
    trial = Trial(0, "initial", 0, best, SignalMetrics(1.0, {}), None, np.ones(3), Feedback({}), (), 0.0)
    run = RunRecord("run", first, {}, {}, "", "finished", (trial,), (), (), trial)
    again = with_its_space(task_at(3.91), run)
    assert again.space[correction].initial == 0.013
    assert "Initial voltage correction at 3.91 V [V]" not in again.space
    elsewhere = with_its_space(task_at(3.5), run).space
    assert elsewhere["Initial voltage correction at 3.50 V [V]"].initial == 0.0


def test_starts_that_a_parameter_set_cannot_hold_are_said_to_begin_anew(tmp_path, monkeypatch) -> None:
    """The correction of a rest voltage was lost without a word: the cell that left 5 mV left 53."""
    (tmp_path / "journal.jsonl").touch()
    run = finished(task_of(at_rest("a", 3.9)))

    def said(given: str) -> str:
        return starts_left_out(given, parameter_source(given))

    monkeypatch.setattr(parameter_source_module, "read_run", lambda folder: run)
    assert said(str(tmp_path)).endswith(f"To keep them: --start-from {tmp_path}")
    unmoved = finished(replace(run.task, space=ParameterSpace((run.task.space[SHAPE],))))
    monkeypatch.setattr(parameter_source_module, "read_run", lambda folder: unmoved)
    assert said(str(tmp_path)) == said("Chen2020") == ""
