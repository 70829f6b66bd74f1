"""Starts that are drawn: the same for anyone, different from each other, inside the ranges."""

import numpy as np
import pytest
from bsa.experiments.suite.starts import start_name, started
from bsa_toy_cell import toy_task


def test_the_base_cell_is_start_0():
    task = toy_task()
    assert started(task, 0) is task
    assert start_name("sei-3", 0) == "sei-3"


def test_starts_are_drawn_by_number_in_the_middle_of_the_ranges():
    task = toy_task()
    drawn = [started(task, number) for number in (1, 1, 2)]
    places = [task.space.to_unit(other.space.initial) for other in drawn]
    assert np.array_equal(places[0], places[1])
    assert np.all(places[0] != places[2])
    assert np.min(places) >= 0.25
    assert np.max(places) <= 0.75
    assert [other.name for other in drawn] == [f"{task.name}-start-{number}" for number in (1, 1, 2)]


def test_nothing_but_the_start_changes():
    task = toy_task()
    other = started(task, 1)
    for before, after in zip(task.space, other.space, strict=True):
        assert (before.name, before.lower, before.upper, before.scale) == (
            after.name,
            after.lower,
            after.upper,
            after.scale,
        )
    assert other.experiments == task.experiments


@pytest.mark.parametrize("key", ["sei-0", "regular-134"])
def test_a_start_shows_in_the_name(key):
    assert start_name(key, 2) == f"{key}-start-2"
