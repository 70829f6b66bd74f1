"""What is left of a task whose search did not add an effect, and what of one that did."""

from dataclasses import replace

from bsa.core.offered_effects import absent_effects, added_parameters, as_found, of_the_found
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from bsa.core.task import CellModel, Task
from bsa.core.trial import Trial
from bsa.testing.sample_task import sample_task

SHARE, TIME, GAP = "slow: share", "slow: time [s]", "gap: size [V]"


def offering() -> Task:
    """A task with two offered effects, one of two parameters."""
    task = sample_task()
    of_effects = (
        Parameter(SHARE, 0.0, 0.0, 0.5, deviation=0.03),
        Parameter(TIME, 3600.0, 600.0, 1e6, "log", prior=True, deviation=0.7),
        Parameter(GAP, 0.0, -1.0, 1.0, deviation=0.1),
    )
    cell = CellModel("Chen2020", effects=("own", "slow", "gap"), offered={"slow": (SHARE, TIME), "gap": (GAP,)})
    return replace(task, cell=cell, space=ParameterSpace((*task.space, *of_effects)))


def trial(index: int, task: Task, **values: float) -> Trial:
    candidate: Candidate = {**task.space.initial, **values}
    return Trial(index, "search", 1, candidate, None, None, None, None, (), 0.0)  # type: ignore[arg-type]


def test_an_effect_is_absent_while_its_strength_is_where_it_began() -> None:
    task = offering()
    assert absent_effects(task, task.space.initial) == ("slow", "gap")
    # Its other parameters change nothing.
    assert absent_effects(task, {**task.space.initial, TIME: 7200.0}) == ("slow", "gap")
    assert added_parameters(task, task.space.initial) == ()
    there = {**task.space.initial, SHARE: 0.03}
    assert absent_effects(task, there) == ("gap",)
    assert added_parameters(task, there) == (SHARE, TIME)


def test_the_task_that_is_found_lacks_what_the_answer_lacks() -> None:
    task = offering()
    trials = [trial(0, task), trial(1, task, **{SHARE: 0.1}), trial(2, task, **{TIME: 7200.0})]
    with_none = as_found(task, trials[2])
    assert with_none.cell.effects == ("own",)
    assert with_none.cell.offered == {}
    assert with_none.space.names == sample_task().space.names
    known = of_the_found(task, with_none, trials)
    assert [one.index for one in known] == [0, 2]
    assert all(tuple(one.candidate) == with_none.space.names for one in known)


def test_an_effect_that_was_added_stays_with_all_trials() -> None:
    task = offering()
    trials = [trial(0, task), trial(1, task, **{SHARE: 0.1}), trial(2, task, **{SHARE: 0.1, GAP: 0.2})]
    with_slow = as_found(task, trials[1])
    assert with_slow.cell.effects == ("own", "slow")
    assert with_slow.space.names[-2:] == (SHARE, TIME)
    known = of_the_found(task, with_slow, trials)
    assert [one.index for one in known] == [0, 1]
    assert GAP not in known[1].candidate


def test_a_task_without_offers_is_found_as_it_is() -> None:
    task = sample_task()
    assert as_found(task, trial(0, task)) is task
    assert of_the_found(task, task, [trial(0, task)])[0].index == 0
