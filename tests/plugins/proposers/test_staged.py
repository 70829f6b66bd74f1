"""Stages: what each looks at, which are skipped and why, and where they end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import bsa
import numpy as np
import pybamm
import pytest
from bsa.core.comparison.residuals import partial_residuals, residuals, rows_of
from bsa.core.errors import BsaError
from bsa.core.feedback import Feedback
from bsa.core.inference.least_squares import LeastSquares
from bsa.core.messages import Usage
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from bsa.core.record import Record
from bsa.core.run.answer import answer
from bsa.core.run.journal import read_events
from bsa.core.run.listener import SILENT, Listener
from bsa.core.run.loop import RunResult
from bsa.core.scaffold import Scaffold, load_scaffold
from bsa.core.segmentation import segment
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task import Experiment, Task
from bsa.core.task_reduction import TaskReduction, shortened
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.core.trial import Trial
from bsa.experiments.run_record import read_run
from bsa.plugins.proposers import stage_fit as stage_fit_module
from bsa.plugins.proposers.stage_data import view_of
from bsa.plugins.proposers.stage_fit import StageChoice, StageFit
from bsa.plugins.proposers.staged import StagedOptions, StagedProposer
from bsa_toy_cell import CAPACITY, HIDDEN, POLARISATION, RELAXATION, SERIES, ToyCell, toy_scaffold, toy_task
from bsa_toy_life import life, life_task

RunToy = Callable[..., RunResult]

STAGES = [
    {"name": "ohmic", "data": "current-steps", "fits": ["Series", "Polarisation"], "share": 0.4},
    {"name": "slow", "data": "open-circuit", "fits": ["Capacity"]},
    {"name": "fast", "data": "rates", "fits": ["Relaxation"], "after": "slow"},
    {"name": "all", "data": "everything"},
]


def staged(**options: Any) -> Scaffold:
    return toy_scaffold("staged", proposer={"use": "staged", "options": {"stages": STAGES, **options}})


def stages_of(folder: Path) -> list[str]:
    found = [event["details"].get("stage") for event in read_events(folder) if event["event"] == "proposal"]
    return list(dict.fromkeys(name for name in found if name))


def skipped_in(folder: Path) -> dict[str, str]:
    events = [event for event in read_events(folder) if event["event"] == "proposal"]
    return {name: why for event in events for name, why in event["details"].get("skipped", {}).items()}


def test_stages_follow_each_other_and_end_at_the_hidden_cell(run_toy: RunToy, tmp_path: Path) -> None:
    result = run_toy(tmp_path / "run", scaffold=staged(), simulations=100)
    assert stages_of(tmp_path / "run") == ["ohmic", "all"]
    assert result.status == "finished"
    for name, value in HIDDEN.items():
        assert result.best.candidate[name] == pytest.approx(value, rel=0.02), name


def test_derivatives_just_measured_are_not_measured_again(
    run_toy: RunToy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[float] = []

    class Watched(LeastSquares):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            if self.jacobian is not None:
                begun.append(self.predicted)

    monkeypatch.setattr(stage_fit_module, "LeastSquares", Watched)
    run_toy(tmp_path / "run", scaffold=staged(order=["all"]), simulations=40)
    assert np.isfinite(begun[0])  # infinite where the derivatives are not those of the start


def test_a_stage_without_data_is_skipped_with_the_reason(run_toy: RunToy, tmp_path: Path) -> None:
    run_toy(tmp_path / "run", scaffold=staged(), simulations=60)
    why = skipped_in(tmp_path / "run")
    assert set(why) == {"slow", "fast"}
    assert "cover less than half of the charge" in why["slow"]
    assert why["fast"] == 'the stage "slow" was skipped'


def test_a_stage_moves_its_own_parameters_only(run_toy: RunToy, tmp_path: Path) -> None:
    result = run_toy(tmp_path / "run", scaffold=staged(order=["ohmic"]), simulations=60)
    start = toy_task().space.initial
    for trial in result.trials:
        assert trial.candidate[CAPACITY] == pytest.approx(start[CAPACITY])
        assert trial.candidate[RELAXATION] == pytest.approx(start[RELAXATION])
    assert result.best.candidate[SERIES] == pytest.approx(HIDDEN[SERIES], rel=0.2)
    assert result.best.candidate[POLARISATION] != start[POLARISATION]


def fitted_again(run_toy: RunToy, folder: Path, off_v: float, **again: Any) -> RunResult:
    """A stage, and one that fits it again, on a record that the toy can follow within ``off_v`` only."""
    task = toy_task()
    experiment = task.experiments[0]
    record = experiment.target.changed(
        voltage=experiment.target.voltage + off_v * np.sin(experiment.target.time / 90.0)
    )
    task = replace(task, experiments=(replace(experiment, target=record),))
    stages = [*STAGES, {"name": "again", "data": "everything", "again": "all", "noise": 2.0, **again}]
    proposer = {"use": "staged", "options": {"stages": stages, "order": ["all", "again"]}}
    simulator = {"use": "toy-cell", "options": {"low_fidelity": True}}
    scaffold = toy_scaffold("staged", proposer=proposer, simulator=simulator)
    return run_toy(folder, task=task, scaffold=scaffold, warm_up=0, simulations=100)


def test_a_stage_is_fitted_again_from_where_it_began(run_toy: RunToy, tmp_path: Path) -> None:
    result = fitted_again(run_toy, tmp_path / "run", 0.02)
    proposals = [event for event in read_events(tmp_path / "run") if event["event"] == "proposal"]
    assert stages_of(tmp_path / "run") == ["all", "again"]
    noise = {
        name: [event["details"]["noise_tolerances"] for event in proposals if event["details"].get("stage") == name]
        for name in ("all", "again")
    }
    assert noise["all"][0] == 10.0
    assert noise["again"][0] == 2.0
    told = [event["rationale"] for event in proposals if event["details"].get("stage") == "again"]
    assert told[0].startswith('Stage "again" (from where "all" began), 4 parameters')
    assert result.best is answer(read_run(tmp_path / "run").task, result.trials)


@pytest.mark.parametrize(
    ("off_v", "more", "why"),
    [
        (0.0, {}, 'the stage "all" was skipped, or left no more noise than this one assumes'),
        (0.02, {"unless": "all"}, 'the stage "all" was carried out'),
    ],
)
def test_a_stage_is_not_fitted_again_without_need(
    run_toy: RunToy, tmp_path: Path, off_v: float, more: dict[str, Any], why: str
) -> None:
    result = fitted_again(run_toy, tmp_path / "run", off_v, **more)
    assert skipped_in(tmp_path / "run")["again"] == why
    assert result.reason == ""


def test_of_two_fits_of_a_stage_the_more_probable_end_stands(task: Task) -> None:
    proposer = StagedProposer(StagedOptions(), Mock(seed=1))
    near = stage_of(task, np.full(len(rows_of(task).record), 5.0))
    far = stage_of(task, np.full(len(rows_of(task).record), 4.0))
    context = Mock(task=task)
    for first, second in ((near, far), (far, near)):
        second.choice = StageChoice(name="again", data="everything", again="all")
        first.choice = StageChoice(name="all", data="everything")
        proposer._end(first, context)
        proposer._here = second.here
        proposer._end(second, context)
        assert proposer._last is far
        assert proposer._here is far.here


@pytest.mark.slow
def test_stages_can_be_repeated_and_left_out(run_toy: RunToy, tmp_path: Path) -> None:
    run_toy(tmp_path / "run", scaffold=staged(order=["all", "ohmic", "all"]), simulations=100)
    assert stages_of(tmp_path / "run") == ["all", "ohmic"]


def test_the_budget_is_kept(run_toy: RunToy, tmp_path: Path) -> None:
    for budget in (1, 4, 7, 12):
        result = run_toy(tmp_path / str(budget), scaffold=staged(), simulations=budget)
        assert len(result.trials) <= budget


def test_a_stage_that_lacks_simulations_is_named_with_how_many_would_do(run_toy: RunToy, tmp_path: Path) -> None:
    few = run_toy(tmp_path / "few", scaffold=staged(order=["ohmic", "all"]), warm_up=0, simulations=12)
    assert few.status == "finished"
    assert few.reason == (
        'Stage "all" is skipped: the 6 simulations left do not suffice for its 4 parameters, which take 7; at most '
        "13 simulations would have been needed."
    )
    assert read_run(tmp_path / "few").lacking == few.reason
    page = unescape((tmp_path / "few" / "report.html").read_text())
    assert f"The run ended short of simulations. {few.reason}" in page
    assert "nothing better to offer" not in page
    enough = run_toy(tmp_path / "enough", scaffold=staged(order=["ohmic", "all"]), warm_up=0, simulations=13)
    assert stages_of(tmp_path / "enough") == ["ohmic", "all"]
    assert enough.reason == 'Stage "all" ended before its next 4 simulations; 2 are left.'


def test_a_stage_that_ends_by_itself_lacks_nothing(run_toy: RunToy, tmp_path: Path) -> None:
    plenty = run_toy(tmp_path / "run", scaffold=staged(order=["ohmic", "all"]), warm_up=0, simulations=100)
    assert plenty.status == "finished"
    assert len(plenty.trials) < 80
    assert plenty.reason == ""


@pytest.mark.slow
def test_a_run_that_was_cut_takes_the_same_path(run_toy: RunToy, tmp_path: Path) -> None:
    whole = run_toy(tmp_path / "whole", scaffold=staged(), simulations=40)
    lines = (tmp_path / "whole" / "journal.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "cut").mkdir()
    (tmp_path / "cut" / "journal.jsonl").write_bytes(b"".join(lines[: len(lines) // 2]))
    resumed = run_toy(tmp_path / "cut", scaffold=staged(), simulations=40)
    assert [trial.candidate for trial in resumed.trials] == [trial.candidate for trial in whole.trials]


def offering(strength: Parameter, **start: float) -> Task:
    """The toy under its measured current, with an offered effect of one parameter; absent where that begins."""
    task = toy_task()
    others = (parameter for parameter in task.space.started(start) if parameter.name != strength.name)
    return replace(
        task,
        experiments=(replace(task.experiments[0], protocol=None),),
        cell=replace(task.cell, effects=("extra",), offered={"extra": (strength.name,)}),
        space=ParameterSpace((*others, strength)),
    )


def with_an_addition(
    run_toy: RunToy, folder: Path, task: Task, listener: Listener = SILENT, led: bool = False
) -> RunResult:
    stages = [{"name": "all", "data": "everything"}, {"name": "add", "data": "everything", "adds": "extra"}]
    proposer = {"use": "staged", "options": {"stages": stages}}
    simulator = {"use": "toy-cell", "options": {"low_fidelity": led}}
    scaffold = toy_scaffold("staged", proposer=proposer, simulator=simulator, offers=[])
    return run_toy(folder, task=task, scaffold=scaffold, warm_up=0, simulations=100, listener=listener)


def notes_of(folder: Path) -> str:
    return " ".join(event["text"] for event in read_events(folder) if event["event"] == "note")


def test_an_effect_that_makes_the_fit_more_probable_is_added(run_toy: RunToy, tmp_path: Path) -> None:
    strength = Parameter(SERIES, 0.05, 0.005, 0.5, "log", deviation=0.2)
    result = with_an_addition(run_toy, tmp_path / "run", offering(strength))
    before = [trial for trial in result.trials if trial.candidate[SERIES] == 0.05]
    assert stages_of(tmp_path / "run") == ["all", "add"]
    # No stage before fits its parameter, and all are fitted where it is added.
    assert [trial.index for trial in before] == list(range(len(before)))
    for name, value in HIDDEN.items():
        assert result.best.candidate[name] == pytest.approx(value, rel=0.02), name
    for task in (result.task, read_run(tmp_path / "run").task):
        assert task.cell.effects == ("extra",)
        assert not task.cell.offered
        assert SERIES in task.space
    assert "The effect extra is in the model: the fit with it is more probable" in notes_of(tmp_path / "run")


def test_an_effect_that_promises_nothing_is_not_simulated(run_toy: RunToy, tmp_path: Path) -> None:
    idle = Parameter("idle", 0.0, 0.0, 1.0, deviation=0.1)
    result = with_an_addition(run_toy, tmp_path / "run", offering(idle), led=True)
    assert all(trial.candidate.get("idle", 0.0) == 0.0 for trial in result.trials)
    assert skipped_in(tmp_path / "run")["add"] == "no step promises a gain"
    assert result.task.cell.effects == ()


def test_an_effect_that_explains_nothing_is_left_out(run_toy: RunToy, tmp_path: Path) -> None:
    idle = Parameter("idle", 0.0, 0.0, 1.0, deviation=0.1)
    result = with_an_addition(run_toy, tmp_path / "run", offering(idle))
    tried = [trial for trial in result.trials if trial.candidate["idle"] > 0.0]
    assert tried
    run = read_run(tmp_path / "run")
    for task, best in ((result.task, result.best), (run.task, run.best)):
        assert task.cell.effects == ()
        assert "idle" not in task.space
        assert set(best.candidate) == set(HIDDEN)
    assert run.best.index == result.best.index < tried[0].index
    assert result.lowest.index == run.lowest.index
    assert "idle" not in run.lowest.candidate
    assert "The effect extra was tried and left out" in notes_of(tmp_path / "run")
    # Taken up again, the run is the same.
    again = with_an_addition(run_toy, tmp_path / "run", offering(idle))
    assert [trial.candidate for trial in again.trials] == [trial.candidate for trial in result.trials]
    assert again.best.index == result.best.index


def test_an_interrupted_run_says_nothing_yet_of_the_effect(run_toy: RunToy, tmp_path: Path) -> None:
    class Stopping(Listener):
        def tried(self, trial: Trial, best: Trial, usage: Usage) -> None:
            if trial.candidate["idle"] > 0.0:
                raise KeyboardInterrupt

    task, folder = offering(Parameter("idle", 0.0, 0.0, 1.0, deviation=0.1)), tmp_path / "run"
    assert with_an_addition(run_toy, folder, task, listener=Stopping()).status == "interrupted"
    assert "The effect" not in notes_of(folder)
    assert with_an_addition(run_toy, folder, task).status == "finished"
    assert notes_of(folder).count("The effect extra was tried and left out") == 1


def test_an_effect_is_not_added_where_it_is_not_offered(run_toy: RunToy, tmp_path: Path) -> None:
    task = replace(toy_task(), experiments=(replace(toy_task().experiments[0], protocol=None),))
    with_an_addition(run_toy, tmp_path / "run", task)
    assert skipped_in(tmp_path / "run")["add"] == 'the effect "extra" is not offered'
    own = replace(task, cell=replace(task.cell, effects=("extra",)))
    with_an_addition(run_toy, tmp_path / "own", own)
    assert skipped_in(tmp_path / "own")["add"] == 'the effect "extra" is in the model from the start'


def test_a_cell_that_fails_with_the_effect_stays_without_it(
    run_toy: RunToy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_of = ToyCell._run

    def fails_with_it(toy: ToyCell, candidate: Candidate, current_a: float) -> ExperimentRun:
        failed = ExperimentRun(None, SimulationFailure("the solver gave up"))
        return failed if candidate.get("idle", 0.0) > 0.0 else run_of(toy, candidate, current_a)

    monkeypatch.setattr(ToyCell, "_run", fails_with_it)
    idle = Parameter("idle", 0.0, 0.0, 1.0, deviation=0.1)
    result = with_an_addition(run_toy, tmp_path / "run", offering(idle))
    assert [trial.index for trial in result.trials if trial.failed] == [len(result.trials) - 1]
    assert result.status == "finished"
    assert result.task.cell.effects == ()


def test_an_unknown_stage_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match='no stage "ohmig"'):
        StagedOptions.model_validate({"stages": STAGES, "order": ["ohmig"]})


def test_the_built_in_stages_are_valid() -> None:
    options = StagedOptions.model_validate(load_scaffold("staged").proposer.options)
    names = [stage.name for stage in options.plan]
    assert names[:6] == ["equilibrium", "kinetics", "transport", "thermal", "joint", "joint-again"]
    assert names[6:] == ["slow-material", "resistive-reactant"]
    assert [stage.adds for stage in options.plan if stage.adds] == load_scaffold("staged").offers


def measured(current: list[float], hours: list[float]) -> Trajectory:
    """Steps of constant current, 25 samples each; the voltage falls with the charge."""
    times, amperes, steps = [], [], []
    begin = 0.0
    for place, (i, duration) in enumerate(zip(current, hours, strict=True)):
        times.append(begin + 1e-3 * (place > 0) + np.linspace(0.0, 3600.0 * duration, 25))
        amperes.append(np.full(25, i))
        kind = StepKind.REST if i == 0 else StepKind.CC_DISCHARGE
        steps.append(Step(kind, 25 * place, 25 * place + 25, position=place))
        begin = times[-1][-1]
    time, amps = np.concatenate(times), np.concatenate(amperes)
    charge = np.concatenate([[0.0], np.cumsum(0.5 * (amps[1:] + amps[:-1]) * np.diff(time))]) / 3600.0
    return Trajectory(time, amps, 4.1 - 0.5 * charge, None, tuple(steps))


@pytest.fixture
def task() -> Task:
    slow = Experiment("slow", measured([0.0, 0.05], [0.5, 20.0]))
    fast = Experiment("fast", measured([0.0, 1.0, 0.0], [0.5, 0.9, 1.0]))
    return replace(toy_task(), experiments=(slow, fast))


@pytest.mark.parametrize(
    ("current", "hours", "covers"),
    [
        ([0.0, 1.0, 0.0], [0.5, 1.0, 0.5], False),
        ([0.0, 1.0, 0.0, 1.0, 0.0], [0.5, 0.5, 0.5, 0.5, 0.5], True),
        ([0.0, 0.05], [0.5, 20.0], True),
    ],
)
def test_rests_at_both_ends_say_nothing_of_the_curve_between(
    current: list[float], hours: list[float], covers: bool
) -> None:
    task = replace(toy_task(), experiments=(Experiment("one", measured(current, hours)),))
    assert (view_of(task, "open-circuit").lacking == "") is covers


def test_rows_say_which_residual_is_about_what(task: Task) -> None:
    rows = rows_of(task)
    offset = Outcome(
        tuple(ExperimentRun(e.target.changed(voltage=e.target.voltage + 2e-3)) for e in task.experiments), 0.0
    )
    found = residuals(task, offset)
    assert found is not None
    assert found == pytest.approx(2.0 * rows.scale)
    assert set(zip(rows.record.tolist(), rows.step.tolist(), strict=True)) == {(0, 0), (0, 1), (1, 0), (1, 1), (1, 2)}


def test_each_stage_sees_the_part_that_informs_it(task: Task) -> None:
    rows = rows_of(task)
    slow = view_of(task, "open-circuit").rows
    assert (0, 1) in set(zip(rows.record[slow].tolist(), rows.step[slow].tolist(), strict=True))
    assert not np.any((rows.record[slow] == 1) & (rows.step[slow] == 1))
    assert np.all((rows.step[slow] == 1) | (rows.since_s[slow] >= 600.0))
    fast = view_of(task, "rates").rows
    assert set(rows.step[fast]) == {1}
    assert set(rows.record[fast]) == {1}
    assert view_of(task, "temperature").lacking
    assert len(view_of(task, "everything").rows) == len(rows.record)


def test_an_offset_before_a_current_step_is_not_held_against_the_kinetics(task: Task) -> None:
    view = view_of(task, "current-steps")
    rows = rows_of(task)
    assert not view.lacking
    assert view(3.0 * rows.scale) == pytest.approx(0.0, abs=1e-9)
    jump = np.where(rows.step == 1, 3.0, 0.0) * rows.scale
    assert np.any(np.abs(view(jump)) > 1.0)


def test_a_stage_fits_more_where_another_was_carried_out() -> None:
    choice = StageChoice(name="k", data="current-steps", fits=["resistance"], fits_after={"slow": ["diffusivity"]})
    assert choice.takes("Contact resistance [Ohm]")
    assert not choice.takes("Particle diffusivity", {"fast"})
    assert choice.takes("Particle diffusivity", {"slow"})


def test_a_parameter_of_which_the_data_say_nothing_keeps_its_prior_and_costs_no_more(
    run_toy: RunToy, tmp_path: Path
) -> None:
    idle = Parameter("Idle [1]", 1.0, 0.1, 10.0, "log", deviation=0.7, prior=True)
    task = toy_task()
    searched = ParameterSpace((*task.space, idle))
    everything = staged(stages=[{"name": "all", "data": "everything"}], order=[])
    result = run_toy(tmp_path / "run", task=replace(task, space=searched), scaffold=everything, simulations=60)
    proposals = [event for event in read_events(tmp_path / "run") if event["event"] == "proposal"]
    counts = [event["rationale"] for event in proposals]
    first_step = [event["action"] for event in proposals].index("refine")
    assert "5 parameters" in counts[0]
    assert all("4 parameters" in text for text in counts[first_step:-1])
    assert result.best.candidate["Idle [1]"] == 1.0
    assert result.best.candidate[CAPACITY] == pytest.approx(HIDDEN[CAPACITY], rel=0.02)


def test_between_two_jacobians_an_emulator_goes_on(run_toy: RunToy, tmp_path: Path) -> None:
    everything = staged(stages=[{"name": "all", "data": "everything"}], order=[])
    run_toy(tmp_path / "run", scaffold=everything, simulations=40)
    told = [event["rationale"] for event in read_events(tmp_path / "run") if event["event"] == "proposal"]
    methods = [words.rsplit(": ", 1)[-1] for words in told]
    assert methods[0] == "finite differences."
    assert "an emulator's step." in methods


def heated(volume: float, transfer: float) -> Record:
    """A discharge at 2C and a rest of an SPM of Chen2020 with one temperature."""
    values = pybamm.ParameterValues("Chen2020")
    values["Cell volume [m3]"] *= volume
    values["Total heat transfer coefficient [W.m-2.K-1]"] *= transfer
    experiment = pybamm.Experiment(["Discharge at 2C for 20 minutes", "Rest for 40 minutes"], period="30 seconds")
    model = pybamm.lithium_ion.SPM({"thermal": "lumped"})
    found = pybamm.Simulation(model, parameter_values=values, experiment=experiment).solve(initial_soc=0.95)
    names = ("Time [s]", "Current [A]", "Voltage [V]", "Volume-averaged cell temperature [K]")
    time, *signals = (found[name].entries for name in names)
    time[1:] += np.where(np.diff(time) <= 0, 1e-3, 0.0)  # both sides of the jump at the end of the discharge
    return Record("heated", segment(Trajectory(time, *signals)), (), 298.15)


@pytest.mark.slow
def test_the_thermal_stage_finds_heat_capacity_and_cooling(tmp_path: Path) -> None:
    found = bsa.calibrate(
        heated(1.6, 3.0),
        parameters="Chen2020",
        model="SPM",
        options={"contact resistance": "false"},
        scale=False,
        initial_soc=0.95,
        scaffold="staged",
        settings={"proposer.options.order": ["thermal"]},
        simulations=20,
        workers=1,
        identifiability=False,
        progress=False,
        out=tmp_path / "run",
    )
    before = pybamm.ParameterValues("Chen2020")
    for name, factor in {"Cell volume [m3]": 1.6, "Total heat transfer coefficient [W.m-2.K-1]": 3.0}.items():
        assert found.parameters[name] == pytest.approx(factor * before[name], rel=0.08), name
    (record,) = read_run(tmp_path / "run").records
    assert record.signals["temperature"].unit == "K"
    assert record.signals["temperature"].rms < 0.25  # a tolerance, to which the fit goes, is 0.2 K


def test_a_record_without_current_has_no_stage(task: Task) -> None:
    resting = replace(task, experiments=(Experiment("rest", measured([0.0], [1.0])),))
    assert "no charge" in view_of(resting, "open-circuit").lacking


def test_a_wrong_option_names_the_stage(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("name: mine\nproposer: {use: staged, options: {stages: [{name: a}]}}\n", encoding="utf-8")
    from bsa.core.contracts.registry import installed
    from bsa.core.hooks import RunContext
    from bsa.core.run.run_plugins import RunPlugins

    with pytest.raises(BsaError, match="data"):
        RunPlugins(load_scaffold(str(path)), RunContext(toy_task(), 1, tmp_path), installed(), print)


def test_a_scan_begins_where_the_data_are_met_best(run_toy: RunToy, tmp_path: Path) -> None:
    """Four values over the range of each parameter, each alone; the derivatives are taken at the best of them."""
    one = {"name": "scanned", "data": "everything", "fits": ["Series"], "scan": 4}
    result = run_toy(tmp_path / "run", scaffold=staged(stages=[one]), simulations=12)
    tried = [trial for trial in result.trials if trial.phase == "search"]
    places = [toy_task().space[SERIES].to_unit(trial.candidate[SERIES]) for trial in tried]
    assert places[:4] == pytest.approx([0.125, 0.375, 0.625, 0.875])
    view = view_of(toy_task(), "everything")
    best = min([result.trials[0], *tried[:4]], key=lambda trial: float(np.sum(view(trial.residuals) ** 2)))
    moved = abs(toy_task().space[SERIES].to_unit(best.candidate[SERIES]) - places[4])
    assert 0.0 < moved < 0.02


def test_a_run_cut_in_the_middle_of_a_batch_simulates_the_rest_of_it(run_toy: RunToy, tmp_path: Path) -> None:
    short = {"scaffold": staged(order=["all"]), "simulations": 16}
    whole = run_toy(tmp_path / "whole", **short)
    lines = (tmp_path / "whole" / "journal.jsonl").read_bytes().splitlines(keepends=True)
    batch = next(place for place, line in enumerate(lines) if b'"action":"jacobian"' in line)
    (tmp_path / "cut").mkdir()
    (tmp_path / "cut" / "journal.jsonl").write_bytes(b"".join(lines[: batch + 3]))
    resumed = run_toy(tmp_path / "cut", **short)
    events = [event for event in read_events(tmp_path / "cut") if event["event"] == "trial"]
    assert sorted(event["index"] for event in events) == list(range(len(whole.trials)))
    assert [trial.candidate for trial in resumed.trials] == [trial.candidate for trial in whole.trials]


def test_a_stage_of_the_first_cycle_simulates_no_other_and_the_life_where_it_ended() -> None:
    task = life_task(life(200, 0.2))
    target = task.experiments[0].target
    choice = next(s for s in StagedOptions.model_validate(load_scaffold("ageing").proposer.options).plan)

    def seen(candidate: Any, reduction: TaskReduction | None) -> Trial:
        """A cell whose voltage is off by its series resistance, and that fails after the first cycle above 0.1 ohm."""
        shown = shortened(task.experiments[0], 1).target if reduction else target
        off = 1e-1 * (candidate[SERIES] / 0.03 - 1.0)
        outcome = Outcome((ExperimentRun(shown.changed(voltage=shown.voltage + off)),))
        whole = None if reduction else residuals(task, outcome)
        partial = partial_residuals(task, outcome) if reduction else None
        return Trial(
            0, "search", 1, candidate, None, None, whole, Feedback(), (), 0.0, reduction=reduction, partial=partial
        )

    start = seen(task.space.initial, None)
    free = np.array([name == SERIES for name in task.space.names])
    stage = StageFit(task, choice, view_of(task, "first-cycle"), free, start, 40)
    here, asked = start, []
    while candidates := stage.ask(40):
        asked.append(stage.reduction)
        here = stage.tell([seen(candidate, stage.reduction) for candidate in candidates])
    assert len(asked) > 2
    assert asked[:-1] == [TaskReduction(cycles=1)] * (len(asked) - 1)
    assert asked[-1] is None
    assert here.residuals is not None
    assert here.candidate[SERIES] == pytest.approx(0.03, rel=0.01)


def test_a_first_cycle_whose_life_fails_is_given_up() -> None:
    task = life_task(life(200, 0.2))
    choice = StagedOptions.model_validate(load_scaffold("ageing").proposer.options).plan[0]
    first = partial_residuals(task, Outcome((ExperimentRun(shortened(task.experiments[0], 1).target),)))
    assert first is not None
    outcome = Outcome(
        (ExperimentRun(task.experiments[0].target.changed(voltage=task.experiments[0].target.voltage + 0.1)),)
    )
    start = Trial(0, "initial", 0, task.space.initial, None, None, residuals(task, outcome), Feedback(), (), 0.0)
    stage = StageFit(task, choice, view_of(task, "first-cycle"), np.ones(4, dtype=bool), start, 40)
    near = replace(start, residuals=None, partial=first, reduction=TaskReduction(cycles=1))
    while (candidates := stage.ask(40)) and stage.reduction is not None:
        # Every other cell has the record's first cycle.
        stage.tell([replace(near, candidate=candidate) for candidate in candidates])
    assert len(candidates) == 1
    failed = replace(start, residuals=None, failure=SimulationFailure("empty"), candidate=candidates[0])
    assert stage.tell([failed]) is start
    assert stage.ask(40) == []


def stage_of(task: Task, residual: np.ndarray, budget: int = 40) -> StageFit:
    """A stage that fits everything to everything, from a start with these residuals."""
    choice = StageChoice(name="all", data="everything")
    start = Trial(0, "initial", 0, task.space.initial, None, None, residual, Feedback(), (), 0.0)
    free = np.ones(len(task.space), dtype=bool)
    return StageFit(task, choice, view_of(task, "everything"), free, start, budget)


def test_a_misfit_of_one_sign_is_weighed_by_its_size(task: Task) -> None:
    """A fit on its way leaves neighbours alike: widened by their correlation, its misfit ended fits at 3 of 0.4 mV."""
    count = len(rows_of(task).record)
    expected = 3.0 * np.sqrt(count / (count - len(task.space)))
    assert stage_of(task, np.full(count, 3.0)).numbers()["noise_tolerances"] == pytest.approx(expected)
    assert stage_of(task, np.full(count, 0.1)).numbers()["noise_tolerances"] == 1.0
    assert stage_of(task, np.full(count, 50.0)).numbers()["noise_tolerances"] == 10.0


def test_the_noise_is_estimated_again_where_a_fit_leaves_less_than_was_assumed(task: Task) -> None:
    """A straight model far from its priors: at the start's noise they hold it, at the noise it leaves they do not."""
    count = len(rows_of(task).record)
    slopes = np.random.default_rng(0).normal(size=(count, len(task.space)))
    known = [replace(parameter, deviation=0.1, prior=True) for parameter in task.space]
    task = replace(task, space=ParameterSpace(tuple(known)))
    start = np.array([parameter.coordinate(task.space.initial[parameter.name]) for parameter in task.space])
    goal = start + 2.0

    def residual(candidate: Any) -> np.ndarray:
        here = np.array([parameter.coordinate(candidate[parameter.name]) for parameter in task.space])
        return 2.0 * slopes @ (here - goal)

    stage = stage_of(task, residual(task.space.initial))
    here, noise = None, []
    while candidates := stage.ask(40):
        noise.append(stage.numbers()["noise_tolerances"])
        here = stage.tell([replace(stage.here, candidate=one, residuals=residual(one)) for one in candidates])
    assert here is not None
    assert noise[0] > 5.0
    assert noise[-1] == 1.0
    assert here.residuals is not None
    assert float(here.residuals @ here.residuals) < 1.0


def test_what_the_misfit_of_a_start_hides_is_fitted(task: Task) -> None:
    """Information on a parameter is that at the end of a fit: at ten tolerances of noise a tenth of it shows."""
    count = len(rows_of(task).record)
    known = [replace(parameter, deviation=1.0, prior=True) for parameter in task.space]
    task = replace(task, space=ParameterSpace(tuple(known)))
    stage = stage_of(task, np.full(count, 50.0))
    weak = np.zeros((count, len(task.space)))
    weak[:, 0] = 0.1 / np.sqrt(count)  # a tolerance for each standard deviation of the prior
    weak[:, 1] = 0.01 / np.sqrt(count)
    assert stage._told(weak).tolist() == [True] + [False] * (len(task.space) - 1)
