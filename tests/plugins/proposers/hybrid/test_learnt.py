"""The hybrid's effects and those of the warm-up are the same numbers in the same unit."""

from pathlib import Path

import numpy as np
import pytest
from bsa.backends.rules.reading import read_prompt
from bsa.core.hooks import NoOptions, RunContext
from bsa.core.messages import Message
from bsa.core.metrics import evaluate
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from bsa.core.prompt_sections import SENSITIVITIES, TASK, section
from bsa.core.sensitivities import Sensitivities
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import Experiment, Task
from bsa.core.trial import Phase, Trial
from bsa.plugins.feedback.structured import StructuredFeedback
from bsa.plugins.memory.sensitivities import SensitivityMemory
from bsa.plugins.proposers.hybrid.learnt import effects
from bsa_toy_cell import HIDDEN, SERIES, record, space, toy_task

LINEAR = Parameter(SERIES, 0.05, -1.0, 1.0)
"""A typical step of 0.1, twenty times a tenth of the value."""


def mixed_task() -> Task:
    """The toy task with one parameter on a linear scale."""
    parameters = tuple(LINEAR if parameter.name == SERIES else parameter for parameter in space())
    return Task("mixed", toy_task().cell, ParameterSpace(parameters), (Experiment("toy", record(HIDDEN)),))


def trial(context: RunContext, index: int, phase: Phase, candidate: Candidate) -> Trial:
    outcome = Outcome((ExperimentRun(record(candidate)),))
    metrics = evaluate(context.task, outcome)
    feedback = StructuredFeedback(NoOptions(), context).build_feedback(outcome, metrics, index)
    return Trial(index, phase, 1, candidate, metrics, None, None, feedback, (), 0.0)


def as_read(content: object) -> dict[str, dict[str, float]]:
    text = section(TASK, {"parameters": {}}) + "\n\n" + section(SENSITIVITIES, dict(content))  # type: ignore[call-overload]
    return {name: dict(rows) for name, rows in read_prompt([Message("user", text)]).sensitivities.effects.items()}


def test_the_rules_read_the_same_effects_from_the_warm_up_and_from_finite_differences(tmp_path: Path) -> None:
    context = RunContext(mixed_task(), 1, tmp_path)
    searched = context.task.space
    base = trial(context, 0, "initial", searched.initial)
    rng = np.random.default_rng(5)
    memory = SensitivityMemory(NoOptions(), context)
    memory.remember(base, None)
    differences = []
    for index, parameter in enumerate(searched, start=1):
        moved = parameter.from_unit(parameter.to_unit(parameter.initial) + 0.01)
        differences.append(trial(context, index, "search", {**searched.initial, parameter.name: moved}))
    for index in range(1, 21):
        near = searched.from_unit(searched.to_unit(searched.initial) + 0.01 * rng.standard_normal(len(searched)))
        memory.remember(trial(context, index, "warm-up", near), None)
    recollection = memory.recall(9000)
    assert recollection is not None
    warm_up = as_read(recollection.content)
    differenced = as_read(Sensitivities(effects(base, differences, searched)).content(9000))
    assert set(warm_up) == set(differenced) == set(searched.names)
    feature = "cc_discharge_middle_shift_mv"
    for name in searched.names:
        assert differenced[name][feature] == pytest.approx(warm_up[name][feature], rel=0.1, abs=0.5)
    # 0.1 Ohm more at 1 A takes 100 mV from the start of the discharge and nothing from its end, the cut-off.
    assert differenced[SERIES][feature] == pytest.approx(-50.0, rel=0.1)
