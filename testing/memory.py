"""What a memory promises."""

from pathlib import Path
from typing import Any, ClassVar

import pytest

from ..core.run.run_plugins import RunPlugins
from ..core.scaffold import Scaffold
from ..core.task import Task
from ..core.trial import Trial
from .run_plugin import RunPluginConformance

BUDGETS = (1_000, 20_000)
"""Characters for a section: those of a small model, and those of a large one."""


class MemoryConformance(RunPluginConformance):
    """Tests of a memory; a subclass gives the fixture ``name``."""

    kind = "memory"
    part: ClassVar[str] = "memories"
    others: ClassVar[dict[str, Any]] = {"feedback": "structured", "warm_up": "random", "proposer": "agent"}

    @pytest.fixture
    def trials(self, scaffold: Scaffold, task: Task, tmp_path: Path) -> tuple[Trial, ...]:
        """The trials of a run: the initial one, a warm-up and a search, failures among them."""
        return self.run(scaffold, task, tmp_path / "earlier").trials

    def test_nothing_need_be_known(self, plugins: RunPlugins, notes: list[str]) -> None:
        """Before the first trial it says nothing, or what it knows."""
        plugins.recall(BUDGETS[-1])
        assert notes == []

    @pytest.mark.parametrize("budget", BUDGETS)
    def test_the_budget_is_kept(
        self, plugins: RunPlugins, trials: tuple[Trial, ...], notes: list[str], budget: int
    ) -> None:
        """A section has at most ``budget`` characters of JSON."""
        for trial in trials:
            plugins.remember(trial, None)
        plugins.recall(budget)
        assert notes == []

    def test_something_is_recalled_and_the_same_again(
        self, scaffold: Scaffold, task: Task, trials: tuple[Trial, ...], tmp_path: Path
    ) -> None:
        """Two that were told the same tell the same, however often they are asked."""
        told: list[Any] = []
        for asked_before in (False, True):
            memory = self.made(scaffold, task, tmp_path, [])
            for trial in trials:
                memory.remember(trial, None)
                if asked_before:
                    memory.recall(BUDGETS[-1])
            told.append(memory.recall(BUDGETS[-1]))
            memory.close()
        assert told[0]
        assert told[0] == told[1]
