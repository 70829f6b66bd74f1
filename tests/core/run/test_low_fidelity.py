"""A run whose simulator has a low-fidelity model: what it simulated is journalled, counted apart, and made once."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from bsa.core.hooks import hookimpl
from bsa.core.run.journal import FILE_NAME, read_events
from bsa.core.run.listener import Listener
from bsa.core.run.loop import RunResult
from bsa.core.run.low_fidelity import LOW_FIDELITY
from bsa.core.scaffold import Scaffold
from bsa.experiments.run_record import read_run
from bsa_toy_cell import HIDDEN, ToyCell, toy_scaffold

RunToy = Callable[..., RunResult]

SHORT = {"rounds": 40, "warm_up": 0, "simulations": 40}


def led(name: str = "least-squares", exists: bool = True) -> Scaffold:
    return toy_scaffold(name, simulator={"use": "toy-cell", "options": {"low_fidelity": exists}})


def low_events(folder: Path) -> list[dict]:
    return [event for event in read_events(folder) if event["event"] == LOW_FIDELITY]


@pytest.mark.parametrize("name", ["least-squares", "hybrid"])
def test_it_finds_the_hidden_cell_in_fewer_simulations(run_toy: RunToy, tmp_path: Path, name: str) -> None:
    alone = run_toy(tmp_path / "alone", scaffold=led(name, exists=False), **SHORT)
    result = run_toy(tmp_path / "led", scaffold=led(name), **SHORT)
    assert alone.low_fidelity_simulations == 0
    assert result.low_fidelity_simulations > 0
    assert len(result.trials) < len(alone.trials)
    for parameter, value in HIDDEN.items():
        assert result.best.candidate[parameter] == pytest.approx(value, rel=0.02), parameter


def test_its_simulations_are_told_apart_from_those_of_the_search(run_toy: RunToy, tmp_path: Path) -> None:
    result = run_toy(tmp_path, scaffold=led(), **SHORT)
    events = low_events(tmp_path)
    assert len(events) == result.low_fidelity_simulations
    assert result.low_fidelity_s == pytest.approx(sum(event["seconds"] for event in events))
    assert result.simulator_s == pytest.approx(result.low_fidelity_s + sum(trial.seconds for trial in result.trials))
    run = read_run(tmp_path)
    assert run.low_fidelity_simulations == len(events)
    assert run.simulator_s == pytest.approx(result.simulator_s)
    assert "low-fidelity model" in " ".join(round_.rationale for round_ in run.rounds)


def test_each_batch_is_counted_from_its_beginning(run_toy: RunToy, tmp_path: Path) -> None:
    """What is left of a batch is told by the time since its beginning, not since that of the first one."""
    told: list[tuple[int, int]] = []

    class Told(Listener):
        def counted(self, purpose: str, done: int, total: int) -> None:
            told.append((done, total))

    run_toy(tmp_path, scaffold=led(), listener=Told(), **SHORT)
    begun = [place for place, (done, _) in enumerate(told) if done == 0]
    assert len(begun) > 1
    for place, end in pairwise([*begun, len(told)]):
        _, total = told[place]
        assert told[place:end] == [(done, total) for done in range(total + 1)]


def test_an_option_leaves_it_out(run_toy: RunToy) -> None:
    proposer = {"use": "least-squares", "options": {"low_fidelity": False}}
    scaffold = Scaffold.model_validate({**led().model_dump(), "proposer": proposer})
    assert run_toy(scaffold=scaffold, **SHORT).low_fidelity_simulations == 0


@pytest.mark.parametrize("share", [0.1, 0.4, 0.7, 0.95])
def test_a_resumed_run_simulates_nothing_again(
    run_toy: RunToy, tmp_path: Path, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run_toy(tmp_path / "whole", scaffold=led(), **SHORT)
    lines = (tmp_path / "whole" / FILE_NAME).read_bytes().splitlines(keepends=True)
    folder = tmp_path / "cut"
    folder.mkdir()
    kept = lines[: 1 + int(share * (len(lines) - 1))]
    (folder / FILE_NAME).write_bytes(b"".join(kept))
    before = len(low_events(folder))
    made: list[dict] = []
    inner = ToyCell.simulate_low_fidelity

    @hookimpl
    def simulate(self: ToyCell, candidates):
        made.extend(candidates)
        return inner(self, candidates)

    monkeypatch.setattr(ToyCell, "simulate_low_fidelity", simulate)
    resumed = run_toy(folder, scaffold=led(), **SHORT)
    assert [dict(trial.candidate) for trial in resumed.trials] == [dict(trial.candidate) for trial in whole.trials]
    assert len(made) == whole.low_fidelity_simulations - before
    places = [tuple(sorted(event["candidate"].items())) for event in low_events(folder)]
    assert len(set(places)) == len(places) == whole.low_fidelity_simulations


def test_one_that_fails_is_journalled_as_such(run_toy: RunToy, tmp_path: Path) -> None:
    options = {"low_fidelity": True, "breaks_above_ohm": 0.051}
    scaffold = toy_scaffold("least-squares", simulator={"use": "toy-cell", "options": options})
    result = run_toy(tmp_path, scaffold=scaffold, **SHORT)
    assert any(event["residuals"] is None for event in low_events(tmp_path))
    assert np.isfinite(result.best.objective)
