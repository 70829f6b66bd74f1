"""What a task promises that can be named without a file."""

import json
from typing import Any

import pytest

from ..core.contracts.products import instance
from ..core.contracts.registry import installed
from ..core.encoding import decode_task, encode_task
from ..core.task import Task
from .entry import EntryConformance


class TaskConformance(EntryConformance):
    """Tests of a task; a subclass gives the fixture ``name``."""

    kind = "task"

    @pytest.fixture
    def task(self, name: str, options: dict[str, Any]) -> Task:
        """The task."""
        return instance(installed().make("task", name, options), Task)

    def test_its_simulator_is_there(self, task: Task) -> None:
        """A task that names one can be run as it is."""
        assert not task.simulator or installed().find("simulator", task.simulator)

    def test_its_records_are_cut_into_steps(self, task: Task) -> None:
        """A match is judged step by step."""
        assert all(experiment.target.steps for experiment in task.experiments)

    def test_it_is_the_same_each_time_and_in_a_journal(self, task: Task, name: str, options: dict[str, Any]) -> None:
        """A run is resumed on the task that it began with."""
        encoded = json.loads(json.dumps(encode_task(task)))
        assert json.loads(json.dumps(encode_task(installed().make("task", name, options)))) == encoded
        assert json.loads(json.dumps(encode_task(decode_task(encoded)))) == encoded
