"""Which scaffold a run has where none is named."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from bsa.core.parameters import ParameterSpace
from bsa.core.task import Task
from bsa.experiments.file_reading import FileReading
from bsa.experiments.request import run_request
from bsa.experiments.task_request import CellChoice, Records
from bsa.testing.sample_task import sample_task

NOTHING = Records((), (), [FileReading()], (), False, False, None)
AS_IT_IS = CellChoice(None, None, (), None, "", True, None, ())


def measured(known: bool = True) -> Task:
    """A task of a measured current, with priors or without."""
    task = sample_task()
    assert task.given_drive
    if not known:
        return task
    return replace(task, space=ParameterSpace(tuple(replace(one, deviation=0.1, prior=True) for one in task.space)))


def scaffold_of(task: Task, scaffold: str | None = None, backend: str = "rules", **settings: Any) -> str:
    asked = run_request(task, NOTHING, AS_IT_IS, scaffold, backend, {}, settings, None, Path("out"))
    return asked.config.scaffold.name


def test_priors_of_a_fit_to_a_measured_current_are_weighed() -> None:
    assert scaffold_of(measured()) == "staged"
    assert scaffold_of(measured(), patience=3, **{"proposer.options.order": ["joint"]}) == "staged"
    assert scaffold_of(measured(known=False)) == "hybrid"


def test_a_protocol_has_no_stages() -> None:
    task = measured()
    steps = (("Discharge at 1 A for 10 minutes",),)
    assert scaffold_of(replace(task, experiments=(replace(task.experiments[0], protocol=steps),))) == "hybrid"


@pytest.mark.parametrize("name", ["hybrid", "least-squares"])
def test_a_scaffold_that_is_named_stays(name: str) -> None:
    assert scaffold_of(measured(), name) == name


def test_a_language_model_has_the_scaffold_that_asks_it() -> None:
    assert scaffold_of(measured(), backend="openai:qwen") == "hybrid"
