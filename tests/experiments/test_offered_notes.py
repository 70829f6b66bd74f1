"""What is said of an effect that a search might add."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from bsa.core.comparison.signal_metrics import SignalMetrics
from bsa.core.feedback import Feedback
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.run.answer import answer
from bsa.core.task import Task
from bsa.core.trial import Trial
from bsa.experiments.offered_notes import offered_notes
from bsa.testing.sample_task import sample_task

RESIDUALS = 40


def offering() -> Task:
    task = sample_task()
    strength = Parameter("extra", 0.0, 0.0, 1.0, deviation=0.1)
    cell = replace(task.cell, effects=("extra",), offered={"extra": ("extra",)})
    return replace(task, cell=cell, space=ParameterSpace((*task.space, strength)))


def trial(index: int, extra: float, misfit: float) -> Trial:
    candidate = {**offering().space.initial, "extra": extra}
    metrics = SignalMetrics(misfit, {})
    residuals = np.full(RESIDUALS, misfit)
    return Trial(index, "search", 1, candidate, metrics, None, residuals, Feedback({}), (), 0.0)


@pytest.mark.parametrize(
    ("having", "answered", "words"),
    [
        ([], 0, None),
        ([trial(1, 0.1, 5.0)], 1, "the fit with it is more probable (misfit 5 tolerances with 1 more parameter, "),
        ([trial(1, 0.1, 9.99)], 0, "was tried and left out: the fit with it is not more probable"),
    ],
    ids=["not tried", "added", "not worth its parameter"],
)
def test_what_became_of_it(having: Sequence[Trial], answered: int, words: str | None) -> None:
    trials = [trial(0, 0.0, 10.0), *having]
    assert answer(offering(), trials).index == answered
    said = list(offered_notes(offering(), trials))
    assert len(said) == (words is not None)
    if words is not None:
        assert words in said[0]
        assert "10 without" in said[0]


def test_a_task_without_offers_says_nothing() -> None:
    assert list(offered_notes(sample_task(), [trial(0, 0.0, 1.0)])) == []
