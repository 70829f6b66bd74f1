"""Situations of a run on the toy cell."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from bsa.core.comparison.residuals import residuals
from bsa.core.hooks import NoOptions, ProposeContext, RunContext
from bsa.core.metrics import evaluate
from bsa.core.proposal import Proposal
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.trial import Phase, Trial
from bsa.plugins.agent.situation import Situation
from bsa.plugins.feedback.structured import ScalarFeedback, StructuredFeedback
from bsa.plugins.memory.history import HistoryMemory, HistoryOptions
from bsa.plugins.memory.priors import Priors
from bsa.plugins.memory.sensitivities import SensitivityMemory
from bsa_toy_cell import CAPACITY, SERIES, record, space, toy_task

MakeSituation = Callable[..., Situation]


@pytest.fixture
def make_situation(tmp_path: Path) -> MakeSituation:
    """A run that tried each parameter alone and then one change that was no better."""

    def make(feedback: str = "structured", memories: bool = True, clipped: tuple[str, ...] = ()) -> Situation:
        context = RunContext(toy_task(), 1, tmp_path)
        builder = {"structured": StructuredFeedback, "scalar": ScalarFeedback}[feedback](NoOptions(), context)
        history = HistoryMemory(HistoryOptions(), context)
        told = [history, SensitivityMemory(NoOptions(), context)] if memories else []

        def tried(index: int, phase: Phase, round_: int, changes: Mapping[str, float]) -> Trial:
            candidate = {**space().initial, **changes}
            outcome = Outcome((ExperimentRun(record(candidate)),))
            metrics = evaluate(context.task, outcome)
            package = builder.build_feedback(outcome, metrics, index)
            found = residuals(context.task, outcome)
            curves = (outcome.runs[0].trajectory,)
            trial = Trial(index, phase, round_, candidate, metrics, None, found, package, curves, 0.0)
            for memory in told:
                memory.remember(trial, Proposal((), hypothesis="a cause"))
            return trial

        start = space().initial
        trials = [tried(0, "initial", 0, {})]
        trials += [
            tried(place, "warm-up", 1, {name: 1.1 * start[name]}) for place, name in enumerate(space().names, start=1)
        ]
        trials.append(tried(len(trials), "search", 1, {CAPACITY: 0.8, SERIES: 0.1}))

        def recall(budget: int) -> list[object]:
            found = [Priors(NoOptions(), context).recall(budget), *(memory.recall(budget) for memory in told)]
            return [part for part in found if part is not None]

        best = min(trials, key=lambda trial: trial.objective)
        asked = ProposeContext(context.task, 2, tuple(trials), best, 7, 9, recall)  # type: ignore[arg-type]
        return Situation.of(asked, trials[-1], clipped)

    return make
