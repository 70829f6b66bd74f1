"""What holds for whatever takes part in a run: runs with it end, keep to their budget and can be resumed."""

import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from ..core.contracts.registry import installed
from ..core.hooks import RunContext
from ..core.messages import Backend
from ..core.run.journal import FILE_NAME, read_events
from ..core.run.loop import RunResult
from ..core.run.run_config import RunConfig
from ..core.run.run_plugins import RunPlugins
from ..core.scaffold import Scaffold
from ..core.task import Task
from . import sample_task as sample
from .entry import EntryConformance

SIMULATIONS, WARM_UP, ROUNDS = 14, 4, 6
"""Budget of the runs: enough for several rounds of every built-in proposer."""


class RunPluginConformance(EntryConformance):
    """Tests of a plugin that takes part in a run; the others of the run are built-in ones that cost nothing."""

    others: ClassVar[dict[str, Any]] = {"feedback": "structured", "warm_up": "random", "proposer": "random"}
    """The scaffold without the plugin under test."""

    part: ClassVar[str]
    """The scaffold's key for the plugin under test."""

    @pytest.fixture(autouse=True, scope="class")
    @classmethod
    def _sample_cell(cls) -> Iterator[None]:
        installed().register(sample, "sample", "bsa.testing 1")
        installed().collect()
        yield
        installed.cache_clear()

    @pytest.fixture
    def task(self) -> Task:
        """What is to be matched; a small task that costs nothing."""
        return sample.sample_task()

    @pytest.fixture
    def scaffold(self, name: str, options: dict[str, Any], task: Task) -> Scaffold:
        """The plugin under test with others."""
        chosen: Any = {"use": name, "options": options}
        content = {"name": "conformance", **self.others, self.part: [chosen] if self.part == "memories" else chosen}
        return Scaffold.model_validate(content).made_for(task.simulator)

    @pytest.fixture
    def notes(self) -> list[str]:
        """What was said of plugins whose answers were left out."""
        return []

    @pytest.fixture
    def plugins(self, scaffold: Scaffold, task: Task, tmp_path: Path, notes: list[str]) -> Iterator[RunPlugins]:
        """The plugins of a run, with every answer checked."""
        made = self.made(scaffold, task, tmp_path, notes)
        yield made
        made.close()

    def made(
        self, scaffold: Scaffold, task: Task, folder: Path, notes: list[str], backend: Backend | None = None
    ) -> RunPlugins:
        """Fresh plugins."""
        context = RunContext(task, 1, folder, backend or _rules())
        return RunPlugins(scaffold, context, installed(), notes.append)

    def run(
        self,
        scaffold: Scaffold,
        task: Task,
        folder: Path,
        backend: Backend | None = None,
        simulations: int = SIMULATIONS,
    ) -> RunResult:
        """A run in a folder, or the rest of one that is there, which may have had another number of simulations."""
        from ..experiments.run import execute_run

        config = RunConfig(scaffold=scaffold, simulations=simulations, warm_up=WARM_UP, rounds=ROUNDS)
        return execute_run(task, config, folder, backend or _rules(), report=False, rebudgeted=True)

    def test_a_run_keeps_to_its_budget(self, scaffold: Scaffold, task: Task, tmp_path: Path) -> None:
        """A run with the plugin ends, simulates no more than it may, and leaves nothing of its answers out."""
        result = self.run(scaffold, task, tmp_path / "run")
        assert 1 <= len(result.trials) <= SIMULATIONS
        assert [event["text"] for event in read_events(tmp_path / "run") if event["event"] == "note"] == []

    def test_a_run_that_was_cut_resumes_to_the_same_trials(
        self, scaffold: Scaffold, task: Task, tmp_path: Path
    ) -> None:
        """What the plugin decides follows from its arguments, its memory and the run's seeds, from nothing else."""
        _disturb_global_generators(1)
        whole = self.run(scaffold, task, tmp_path / "run")
        journal = tmp_path / "run" / FILE_NAME
        lines = journal.read_bytes().splitlines(keepends=True)
        trials = [number for number, line in enumerate(lines) if line.startswith(b'{"event":"trial"')]
        journal.write_bytes(b"".join(lines[: trials[len(trials) // 2] + 1]))
        _disturb_global_generators(2)
        resumed = self.run(scaffold, task, tmp_path / "run")
        assert [trial.candidate for trial in resumed.trials] == [trial.candidate for trial in whole.trials]

    def test_a_run_that_is_given_more_simulations_keeps_those_that_it_made(
        self, scaffold: Scaffold, task: Task, tmp_path: Path
    ) -> None:
        """Taken up again with more, and then once more, it asks for the same and goes on."""
        few = self.run(scaffold, task, tmp_path / "run", simulations=SIMULATIONS // 2)
        more = self.run(scaffold, task, tmp_path / "run")
        again = self.run(scaffold, task, tmp_path / "run")
        assert len(more.trials) <= SIMULATIONS
        assert [trial.candidate for trial in more.trials][: len(few.trials)] == [t.candidate for t in few.trials]
        assert [trial.candidate for trial in again.trials] == [trial.candidate for trial in more.trials]


def _rules() -> Backend:
    model: Backend = installed().make("backend", "rules", {})
    return model


def _disturb_global_generators(seed: int) -> None:
    # A plugin that draws from them draws something else in the resumed run.
    random.seed(seed)
    np.random.seed(seed)
