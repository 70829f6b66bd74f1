from dataclasses import replace
from pathlib import Path

import pytest
from bsa.core.hooks import NoOptions, ProposeContext, RunContext
from bsa.core.parameters import ParameterSpace
from bsa.core.task import Task
from bsa.core.trial import Trial
from bsa.plugins.warm_up.each_alone import EachAloneWarmUp
from bsa_toy_cell import space, toy_task


def candidates(task: Task, folder: Path, simulations: int) -> list[dict[str, float]]:
    start = Trial(0, "initial", 0, dict(task.space.initial), None, None, None, None, (), 0.0)  # type: ignore[arg-type]
    asked = ProposeContext(task, 1, (start,), start, 1, simulations, lambda budget: [])
    warm_up = EachAloneWarmUp(NoOptions(), RunContext(task, 1, folder))
    return [dict(candidate) for candidate in warm_up.warm_up(asked).candidates]


def test_each_parameter_moves_alone_by_a_step(tmp_path: Path) -> None:
    found = candidates(toy_task(), tmp_path, 20)
    steps = [space().steps_between(space().initial, candidate) for candidate in found]
    assert len(found) == len(space())
    for place, change in enumerate(steps):
        assert change[place] == pytest.approx(1.0)
        assert abs(change).sum() == pytest.approx(1.0)


def test_at_a_bound_a_parameter_moves_away_from_it(tmp_path: Path) -> None:
    at_bound = ParameterSpace([replace(one, upper=one.initial) for one in space()])
    found = candidates(replace(toy_task(), space=at_bound), tmp_path, 20)
    for place, candidate in enumerate(found):
        assert at_bound.steps_between(at_bound.initial, candidate)[place] == pytest.approx(-1.0)


def test_it_keeps_to_its_simulations(tmp_path: Path) -> None:
    assert len(candidates(toy_task(), tmp_path, 2)) == 2
