"""What a feedback builder promises."""

from typing import ClassVar

import pytest

from ..core.metrics import evaluate
from ..core.run.run_plugins import RunPlugins
from ..core.simulation import ExperimentRun, Outcome, SimulationFailure
from ..core.task import Task
from .run_plugin import RunPluginConformance


class FeedbackConformance(RunPluginConformance):
    """Tests of a feedback builder; a subclass gives the fixture ``name``."""

    kind = "feedback"
    part: ClassVar[str] = "feedback"

    @pytest.fixture
    def outcome(self, plugins: RunPlugins, task: Task) -> Outcome:
        """A simulation of the initial candidate."""
        return next(outcome for _, outcome in plugins.simulate([task.space.initial], False))

    def test_something_is_told_of_a_simulation(self, plugins: RunPlugins, task: Task, outcome: Outcome) -> None:
        """The content is JSON-ready and not empty; images lie in the run's folder."""
        assert plugins.build_feedback(outcome, evaluate(task, outcome), 0).content

    def test_the_same_outcome_has_the_same_feedback(self, plugins: RunPlugins, task: Task, outcome: Outcome) -> None:
        """A resumed run builds what it built before."""
        first, second = (plugins.build_feedback(outcome, evaluate(task, outcome), 0) for _ in range(2))
        assert first == second

    def test_something_is_told_of_a_failure(self, plugins: RunPlugins, task: Task, outcome: Outcome) -> None:
        """Without metrics there is still the cause, whether some of the record was reached or nothing."""
        failure = SimulationFailure("the solver gave up", reached_s=60.0)
        for reached in (None, outcome.runs[0].trajectory):
            failed = Outcome((ExperimentRun(reached, failure),) * len(task.experiments))
            assert plugins.build_feedback(failed, None, 1).content
