"""A run that is taken up again with another number of simulations."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from bsa.core.errors import BsaError
from bsa.core.run.budget import BUDGET
from bsa.core.run.journal import FILE_NAME, LOCK, read_events
from bsa.core.run.loop import RunResult
from bsa.core.scaffold import Scaffold
from bsa.experiments.run import read_request
from bsa.experiments.run_record import read_run
from bsa_toy_cell import toy_scaffold

RunToy = Callable[..., RunResult]

STAGES = [
    {"name": "ohmic", "data": "current-steps", "fits": ["Series", "Polarisation"], "share": 0.4},
    {"name": "joint", "data": "everything"},
]
METHODS = {
    "full": toy_scaffold(),
    "hybrid": toy_scaffold("hybrid"),
    "least-squares": toy_scaffold("least-squares"),
    "staged": toy_scaffold("staged", proposer={"use": "staged", "options": {"stages": STAGES}}),
    "cma-es": toy_scaffold("cma-es"),
    "de": toy_scaffold("de"),
    "random": toy_scaffold("random"),
}
COMMON: dict[str, Any] = {"warm_up": 2, "rounds": 40, "patience": 40}


def tried(folder: Path) -> list[dict[str, float]]:
    return [dict(trial.candidate) for trial in read_run(folder).trials]


@pytest.mark.slow
@pytest.mark.parametrize("scaffold", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("first", [1, 4, 6])
def test_a_spent_run_goes_on_where_it_ended(run_toy: RunToy, tmp_path: Path, scaffold: Scaffold, first: int) -> None:
    """Whatever the round that the smaller budget cut off, and again behind a second rise."""
    folder = tmp_path / "run"
    run_toy(folder, scaffold, simulations=first, **COMMON)
    before = tried(folder)
    for allowed in (first + 1, 10, 12):
        result = run_toy(folder, scaffold, simulations=allowed, rebudgeted=True, **COMMON)
        # A stage begins only where it can be carried out.
        ended = result.status == "finished" and (len(result.trials) > 8 or "is skipped" in result.reason)
        assert len(result.trials) == allowed or ended
        now = tried(folder)
        assert now[: len(before)] == before
        before = now
    assert read_request(folder)[1].simulations == 12
    assert read_run(folder).config["simulations"] == 12
    again = run_toy(folder, scaffold, simulations=12, **COMMON)
    assert [dict(trial.candidate) for trial in again.trials] == before


@pytest.mark.slow
@pytest.mark.parametrize("scaffold", [METHODS["full"], METHODS["hybrid"]], ids=["full", "hybrid"])
def test_a_run_with_a_larger_budget_resumes_to_the_same_wherever_it_is_cut(
    run_toy: RunToy, tmp_path: Path, scaffold: Scaffold
) -> None:
    run_toy(tmp_path / "run", scaffold, simulations=7, **COMMON)
    whole = run_toy(tmp_path / "run", scaffold, simulations=14, rebudgeted=True, **COMMON)
    lines = (tmp_path / "run" / FILE_NAME).read_bytes().splitlines(keepends=True)
    raised = next(number for number, line in enumerate(lines) if line.startswith(b'{"event":"budget"'))
    for kept in range(raised + 1, len(lines), 2):
        folder = tmp_path / f"cut-{kept}"
        folder.mkdir()
        (folder / FILE_NAME).write_bytes(b"".join(lines[:kept]))
        resumed = run_toy(folder, scaffold, simulations=14, **COMMON)
        assert [dict(trial.candidate) for trial in resumed.trials] == [dict(trial.candidate) for trial in whole.trials]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["full", "hybrid", "staged", "cma-es"])
def test_a_run_that_is_cut_anywhere_can_be_given_more(run_toy: RunToy, tmp_path: Path, name: str) -> None:
    """A round that was begun, with a reply or a proposal in the journal, is ended as it was begun."""
    scaffold = METHODS[name]
    run_toy(tmp_path / "run", scaffold, simulations=9, **COMMON)
    lines = (tmp_path / "run" / FILE_NAME).read_bytes().splitlines(keepends=True)
    for kept in range(1, len(lines), 3):
        folder = tmp_path / f"cut-{kept}"
        folder.mkdir()
        (folder / FILE_NAME).write_bytes(b"".join(lines[:kept]))
        result = run_toy(folder, scaffold, simulations=12, rebudgeted=True, **COMMON)
        assert len(result.trials) == 12 or result.status == "finished"
        again = run_toy(folder, scaffold, simulations=12, **COMMON)
        assert [dict(trial.candidate) for trial in again.trials] == [dict(trial.candidate) for trial in result.trials]


@pytest.mark.slow
def test_stages_that_lacked_simulations_are_carried_out_with_more(run_toy: RunToy, tmp_path: Path) -> None:
    scaffold, few = METHODS["staged"], {"warm_up": 0, "rounds": 80}
    first = run_toy(tmp_path / "run", scaffold, simulations=12, **few)
    assert "joint" in first.reason
    result = run_toy(tmp_path / "run", scaffold, simulations=30, rebudgeted=True, **few)
    assert result.reason == ""
    stages = [one.details.get("stage") for one in read_run(tmp_path / "run").rounds]
    assert "joint" in stages
    assert result.best.objective < first.best.objective


def test_a_run_that_still_has_too_few_is_not_said_to_have_ended_by_itself(run_toy: RunToy, tmp_path: Path) -> None:
    run_toy(tmp_path, METHODS["staged"], simulations=2, warm_up=0)
    still = run_toy(tmp_path, METHODS["staged"], simulations=3, warm_up=0, rebudgeted=True)
    assert "is skipped" in still.reason
    assert not any("ended by itself" in note for note in read_run(tmp_path).notes)


def test_an_interrupted_run_may_be_given_less(run_toy: RunToy, tmp_path: Path) -> None:
    run_toy(tmp_path / "run", METHODS["full"], simulations=9, **COMMON)
    journal = tmp_path / "run" / FILE_NAME
    lines = journal.read_bytes().splitlines(keepends=True)
    third = [number for number, line in enumerate(lines) if line.startswith(b'{"event":"trial"')][3]
    journal.write_bytes(b"".join(lines[: third + 1]))
    assert len(run_toy(tmp_path / "run", METHODS["full"], simulations=6, rebudgeted=True, **COMMON).trials) == 6
    assert len(run_toy(tmp_path / "run", METHODS["full"], simulations=8, rebudgeted=True, **COMMON).trials) == 8


def test_more_rounds_go_on_behind_the_last(run_toy: RunToy, tmp_path: Path) -> None:
    first = run_toy(tmp_path, rounds=2, simulations=30)
    assert first.status == "rounds-spent"
    second = run_toy(tmp_path, rounds=4, simulations=30, rebudgeted=True)
    assert len(second.trials) > len(first.trials)
    assert read_request(tmp_path)[1].rounds == 4


@pytest.mark.slow
def test_more_patience_goes_on_behind_the_last_idle_round(run_toy: RunToy, tmp_path: Path) -> None:
    limits = {"simulations": 30, "rounds": 40, "warm_up": 2}
    first = run_toy(tmp_path, patience=2, **limits)
    assert first.status == "converged"
    before = tried(tmp_path)
    run_toy(tmp_path, patience=2, **{**limits, "simulations": 40}, rebudgeted=True)
    assert any(f"bsa run --resume {tmp_path} --set patience=4" in note for note in read_run(tmp_path).notes)
    second = run_toy(tmp_path, patience=6, **{**limits, "simulations": 40}, rebudgeted=True)
    assert len(second.trials) > len(first.trials)
    assert tried(tmp_path)[: len(before)] == before
    assert read_request(tmp_path)[1].patience == 6
    with pytest.raises(BsaError, match="--set patience=5 is less than the 6 of the run"):
        run_toy(tmp_path, patience=5, **{**limits, "simulations": 40}, rebudgeted=True)


def test_less_than_was_done_is_refused_and_nothing_is_written(run_toy: RunToy, tmp_path: Path) -> None:
    run_toy(tmp_path, simulations=9)
    before = (tmp_path / FILE_NAME).read_bytes()
    with pytest.raises(BsaError, match="has made 9 simulations, which is more than --simulations 8"):
        run_toy(tmp_path, simulations=8, rebudgeted=True)
    with pytest.raises(BsaError, match="--rounds 3 is less than the 12 of the run"):
        run_toy(tmp_path, simulations=9, rounds=3, rebudgeted=True)
    with pytest.raises(BsaError, match="simulations"):
        read_request(tmp_path, {"simulations": 0})
    assert (tmp_path / FILE_NAME).read_bytes() == before


def test_the_same_command_with_more_says_how_the_run_goes_on(run_toy: RunToy, tmp_path: Path) -> None:
    run_toy(tmp_path, simulations=9)
    with pytest.raises(BsaError) as refused:
        run_toy(tmp_path, simulations=12)
    assert f"bsa run --resume {tmp_path} --simulations 12" in refused.value.hint


@pytest.mark.slow
def test_what_the_record_fixes_is_found_out_anew(run_toy: RunToy, tmp_path: Path) -> None:
    """Though the best simulation may be the same; what was said of the earlier end is no longer said."""
    scaffold = METHODS["least-squares"]
    first = run_toy(tmp_path, scaffold, simulations=9, warm_up=0, analysing=True)
    assert first.analysis is not None
    assert first.analysis.budget == 9
    second = run_toy(tmp_path, scaffold, simulations=30, warm_up=0, analysing=True, rebudgeted=True)
    assert second.analysis is not None
    assert second.analysis.budget == 30
    found = read_run(tmp_path)
    assert found.analysis is not None
    assert found.analysis.budget == 30
    assert any("30 simulations in all, before 9" in note for note in found.notes)
    kinds = [event["event"] for event in read_events(tmp_path)]
    assert kinds.count(BUDGET) == 1
    assert kinds.count("appraisal") == 2


def test_a_cell_of_a_grid_keeps_its_budget(run_toy: RunToy, tmp_path: Path) -> None:
    """Its identity, by which other grids find its result, has the budget in it."""
    run_toy(tmp_path, simulations=9)
    (tmp_path / LOCK).touch()
    with pytest.raises(BsaError, match="is a run of a grid") as refused:
        run_toy(tmp_path, simulations=12, rebudgeted=True)
    assert "without its file lock" in refused.value.hint
    assert len(run_toy(tmp_path, simulations=9, rebudgeted=True).trials) == 9
