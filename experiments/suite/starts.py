"""Other starts of a case than its base cell: drawn by number, so that anyone draws the same ones."""

from dataclasses import replace

import numpy as np

from ...core.task import Task

BASE_CELL = 0
"""The start that is not drawn."""

_MIDDLE = (0.25, 0.75)
"""Part of each range in which starts lie: at the ends of all ranges at once few cells run."""


def start_name(key: str, number: int) -> str:
    """``"sei-3"``, ``"sei-3-start-2"``."""
    return key if number == BASE_CELL else f"{key}-start-{number}"


def started(task: Task, number: int) -> Task:
    """The task with another start.

    0 leaves it as it is. Any other number draws every parameter at random in the middle half of its range, on its own
    scale, by the task's name and this number.
    """
    if number == BASE_CELL:
        return task
    rng = np.random.default_rng([number, *task.name.encode()])
    drawn = task.space.from_unit(rng.uniform(*_MIDDLE, size=len(task.space)))
    return replace(task, name=start_name(task.name, number), space=task.space.started(drawn))
