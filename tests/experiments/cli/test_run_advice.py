"""What `bsa run` says at its end: the command that looks further, and whether a measurement would help."""

import json
import sys
from dataclasses import replace
from types import SimpleNamespace

import pytest
import typer
from bsa.backends.rules.backend import RulesBackend
from bsa.core.cell import CELL
from bsa.core.inference.identifiability import Identifiability, Interval
from bsa.core.inference.measure_next import Suggestion
from bsa.core.inference.post_fit_analysis import PostFitAnalysis
from bsa.core.messages import Usage
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.run.allowance import Allowance
from bsa.core.run.journal import read_events
from bsa.core.run.run_config import RunConfig
from bsa.core.target import OcpShape
from bsa.core.task import CellModel
from bsa.experiments.cli.run import _asks_a_person, _execute, _goes_beyond_its_set, _how_to_go_on, _print_summary
from bsa.experiments.report.identifiability import caution_line, next_line
from bsa.experiments.request import RunRequest
from bsa.experiments.run import Resources, discovery_command_of
from bsa.experiments.run_record import read_run
from bsa_toy_cell import toy_scaffold, toy_task

WIDE = "Contact resistance [Ohm]"
CELL_MODEL = CellModel("Chen2020", "SPM")


def test_a_structured_misfit_points_to_the_command_and_a_good_fit_does_not(run_toy, tmp_path) -> None:
    from bsa.backends.rules.backend import RulesBackend
    from bsa.experiments.run import execute_run

    def notes(simulations: int) -> list[str]:
        folder = tmp_path / str(simulations)
        config = RunConfig(scaffold=toy_scaffold("least-squares"), rounds=20, warm_up=0, simulations=simulations)
        task = toy_task()
        task = replace(task, experiments=(replace(task.experiments[0], protocol=None),))
        execute_run(task, config, folder, RulesBackend(), report=False, to_discover="bsa discover X")
        return [event["text"] for event in read_events(folder) if event["event"] == "note"]

    assert any("bsa discover X" in text for text in notes(1))
    assert not any("bsa discover" in text for text in notes(40))


def test_a_discovery_begins_with_the_fitted_cell_where_the_set_lacks_what_was_fitted() -> None:
    task = toy_task()
    shape = Parameter("bump", 0.0, -0.1, 0.1, target=OcpShape("Positive", 0.5))
    corrected = replace(task, space=ParameterSpace((*task.space, shape)))
    with_effect = replace(task, cell=replace(CELL_MODEL, effects=("ocp-hysteresis",)))
    plain = replace(task, cell=CELL_MODEL)
    assert not _goes_beyond_its_set(plain, "", "Chen2020")
    assert _goes_beyond_its_set(plain, "nearest", "Chen2020")
    assert _goes_beyond_its_set(plain, "", "nearest")
    assert _goes_beyond_its_set(corrected, "", "Chen2020")
    assert _goes_beyond_its_set(with_effect, "", "Chen2020")


def test_the_end_names_a_stage_that_lacked_simulations(run_toy, tmp_path, capsys) -> None:
    stages = [
        {"name": "ohmic", "data": "current-steps", "fits": ["Series", "Polarisation"], "share": 0.4},
        {"name": "joint", "data": "everything"},
    ]
    scaffold = toy_scaffold("staged", proposer={"use": "staged", "options": {"stages": stages}})
    _print_summary(run_toy(scaffold=scaffold, warm_up=0, simulations=12), tmp_path / "run", "toy-cell")
    first, *_, said, report = capsys.readouterr().out.splitlines()
    assert first.startswith("finished, short of simulations, after 6 simulations")
    assert said.startswith('  Stage "joint" is skipped: the 6 simulations left do not suffice')
    assert report.startswith("  report: ")


def analysis(worst_share: float) -> PostFitAnalysis:
    found = Identifiability({WIDE: Interval(0.1, 0.0, 0.3, 0.5, "open")}, (), (), 1.0, 40)
    suggestion = Suggestion("C/20 discharge", (), 20.0, WIDE, worst_share, {WIDE: worst_share})
    return PostFitAnalysis(0, found, worst=WIDE, measure_next=(suggestion,))


def test_advice_is_given_only_where_it_helps() -> None:
    assert "To measure next: C/20 discharge" in next_line(analysis(0.3), CELL)
    line = next_line(analysis(0.48), CELL)
    assert line.startswith("No protocol considered would narrow the widest interval (± 50 %")
    assert next_line(replace(analysis(0.3), measure_next=()), CELL) == ""


def test_an_analysis_that_its_budget_ended_says_what_was_dropped() -> None:
    assert caution_line(analysis(0.3)) == ""
    ended = replace(analysis(0.3), measure_next=(), simulations=81, budget=92, widened=6.4, forgone=24)
    assert caution_line(ended).startswith(
        "The analysis stopped after 81 simulations (it makes 92 at most, as many as the search may make), before its "
    )
    assert "multiplied by 6.4" in caution_line(ended)
    assert (
        next_line(ended, CELL) == "What to measure next was not looked for: the analysis lacked 24 simulations for it."
    )
    longer = "With more --simulations the analysis is longer"
    assert [line.count(longer) for line in (caution_line(ended), next_line(ended, CELL))] == [1, 0]
    assert longer in next_line(replace(ended, widened=1.0), CELL)


@pytest.mark.slow
def test_a_spent_run_says_how_it_goes_on_and_that_command_does(run_toy, tmp_path, capsys) -> None:
    from bsa.experiments.cli.main import app
    from typer.testing import CliRunner

    config = RunConfig(scaffold=toy_scaffold(), backend="rules", simulations=6, warm_up=2)
    _execute(RunRequest(toy_task(), config, tmp_path / "run"), Resources(), False, False)
    told = capsys.readouterr().out
    (more,) = (line for line in told.splitlines() if "To search on: " in line)
    (fixed,) = (line for line in told.splitlines() if "What the record fixes was not looked for" in line)
    command = more.partition("To search on: ")[2]
    assert command == f"bsa-run --resume {tmp_path / 'run'} --no-identifiability --simulations 12"
    went_on = CliRunner().invoke(app(), ["run", *command.split()[1:], "--json"])
    assert went_on.exit_code == 0, went_on.output
    assert json.loads(went_on.stdout)["simulations"] == 12
    assert "is not taken" not in went_on.stderr
    command = fixed.partition("to find out: ")[2]
    assert command == f"bsa-run --resume {tmp_path / 'run'}"
    looked = CliRunner().invoke(app(), ["run", *command.split()[1:], "--json"])
    assert json.loads(looked.stdout)["identifiability"]["budget"] == 12


@pytest.mark.slow
def test_a_run_that_its_rounds_ended_is_advised_more_of_them(tmp_path, capsys) -> None:
    config = RunConfig(scaffold=toy_scaffold(), backend="rules", simulations=30, warm_up=2, rounds=2)
    _execute(RunRequest(toy_task(), config, tmp_path / "run"), Resources(), False, True)
    assert f"To search on: bsa-run --resume {tmp_path / 'run'} --rounds 4" in capsys.readouterr().out


def test_a_run_that_ended_by_itself_says_that_more_simulations_add_nothing(tmp_path, capsys) -> None:
    config = RunConfig(scaffold=toy_scaffold("least-squares"), backend="rules", simulations=60, warm_up=0)
    _execute(RunRequest(toy_task(), config, tmp_path / "run"), Resources(), False, False)
    told = capsys.readouterr().out
    assert "To search on" not in told
    assert "To go on with more simulations" not in told
    more = config.model_copy(update={"simulations": 80})
    _execute(RunRequest(toy_task(), more, tmp_path / "run"), Resources(), False, False, resumed=True)
    assert "had ended by itself and not by its budget" in capsys.readouterr().err


def test_fewer_simulations_than_were_made_are_refused_in_a_line(run_toy, tmp_path, monkeypatch, capsys) -> None:
    from bsa.experiments.cli.main import main

    run_toy(tmp_path / "run", simulations=9)
    monkeypatch.setattr(sys, "argv", ["bsa", "run", "--resume", str(tmp_path / "run"), "--simulations", "5"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "has made 9 simulations, which is more than --simulations 5" in capsys.readouterr().err


def test_the_command_that_looks_for_what_lacks_is_told_again_when_a_run_goes_on(tmp_path, capsys) -> None:
    task = toy_task()
    task = replace(task, experiments=(replace(task.experiments[0], protocol=None),))
    config = RunConfig(scaffold=toy_scaffold("least-squares"), backend="rules", simulations=1, warm_up=0)
    _execute(RunRequest(task, config, tmp_path / "run"), Resources(), False, False, "bsa discover X")
    assert discovery_command_of(tmp_path / "run") == "bsa discover X"
    assert any("bsa discover X" in note for note in read_run(tmp_path / "run").notes)
    more = config.model_copy(update={"simulations": 40})
    _execute(RunRequest(task, more, tmp_path / "run"), Resources(), False, False, "bsa discover X", resumed=True)
    # The fit is good by now; what was said of the end before is taken back.
    assert not any("bsa discover" in note for note in read_run(tmp_path / "run").notes)


def test_a_run_whose_analysis_lacks_simulations_says_the_command_though_its_search_had_ended(tmp_path) -> None:
    config = RunConfig(scaffold=toy_scaffold(), backend="rules", simulations=60)
    heard = {"unusable_replies": 0, "llm_calls": 0, "lost_calls": 0}
    settled = SimpleNamespace(
        status="finished", reason="", cut_short=False, analysis=analysis(0.3), trials=[1, 2], **heard
    )
    assert list(_how_to_go_on(settled, config, tmp_path / "run", True)) == []
    unsettled = SimpleNamespace(**{**vars(settled), "analysis": replace(analysis(0.3), unsettled=("a",))})
    # The search would use no more.
    assert list(_how_to_go_on(unsettled, config, tmp_path / "run", True)) == []
    lacking = SimpleNamespace(**{**vars(settled), "analysis": replace(analysis(0.3), forgone=22)})
    assert list(_how_to_go_on(lacking, config, tmp_path / "run", True)) == [
        f"To go on with more simulations: bsa-run --resume {tmp_path / 'run'} --simulations 120"
    ]


def test_a_spent_allowance_holds_when_the_run_goes_on_and_the_command_gives_twice_it(
    tmp_path, monkeypatch, capsys
) -> None:
    plain = RulesBackend.complete
    monkeypatch.setattr(
        RulesBackend, "complete", lambda *given, **seed: replace(plain(*given, **seed), usage=Usage(50, 50, 0, 0.01))
    )
    config = RunConfig(scaffold=toy_scaffold("full"), backend="rules", simulations=12, warm_up=2, rounds=6)
    folder = tmp_path / "run"

    def ended() -> str:
        _execute(RunRequest(toy_task(), config, tmp_path / "unlimited"), Resources(), False, False)
        return capsys.readouterr().out

    assert "\n  language model: 7 calls, 700 tokens, $0.0700\n" in ended()

    def stopped(*limits: float | None) -> str:
        with pytest.raises(typer.Exit):
            _execute(
                RunRequest(toy_task(), config, folder), Resources(1, Allowance(*limits)), True, False, resumed=True
            )
        return capsys.readouterr().err.splitlines()[-1]

    go_on = f"Go on with: bsa-run --resume {folder} --no-identifiability"
    by_cost = f"Stopped: $0.0200 spent of --max-cost 0.02. {go_on} --max-cost 0.04"
    assert stopped(None, 0.02) == by_cost
    assert stopped() == by_cost
    assert stopped(150, 0.04) == f"Stopped: 200 tokens used of --max-tokens 150. {go_on} --max-tokens 400"


def test_the_name_of_a_task_does_not_steer_the_terminal(tmp_path, capsys) -> None:
    config = RunConfig(scaffold=toy_scaffold(), backend="rules", simulations=1, warm_up=0)
    task = replace(toy_task(), name="a\x1b[2Jb\nc")
    _execute(RunRequest(task, config, tmp_path / "run"), Resources(), False, False)
    told = capsys.readouterr()
    assert "\x1b" not in told.err + told.out
    assert told.err.splitlines()[0].endswith(f"→ {tmp_path / 'run'}")


@pytest.mark.parametrize(
    ("backend", "options", "asks"),
    [
        ("rules", {}, False),
        ("rules", {"review": True}, True),
        ("manual", {}, True),
        ("manual", {"exchange": "talks"}, False),
    ],
)
def test_nothing_is_redrawn_where_a_person_types(backend: str, options: dict[str, object], asks: bool) -> None:
    assert _asks_a_person(RunConfig(scaffold=toy_scaffold(), backend=backend, backend_options=options)) == asks
