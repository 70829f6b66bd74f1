"""Cycles left out of a cell that is three numbers: two that age, and one that each cycle sets anew."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from bsa.core.trajectory import FloatArray, Trajectory
from bsa.plugins.pybamm.solving.cycle_jumps import CycleFailed, CycleRunner, SolvedCycle

NOTHING = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
Ageing = Callable[[FloatArray], FloatArray]


def film_growth(state: FloatArray) -> FloatArray:
    """Lithium and film thickness under growth that the film itself hinders; the third number settles at once."""
    lithium, film, _ = state
    growth = 2e-3 / film
    return np.array([lithium - growth, film + 50.0 * growth, 0.1 * lithium])


def late_knee(state: FloatArray) -> FloatArray:
    """A slow loss, and one that feeds on itself."""
    lithium, film, _ = state
    return np.array([lithium - 2e-4 - 1e-5 * film, film * 1.01, 0.1 * lithium])


class Cell:
    """Counts the cycles that are simulated, and dies below a capacity."""

    def __init__(self, ageing: Ageing, dies_below: float = -np.inf) -> None:
        self._ageing, self._dies_below = ageing, dies_below
        self.simulated: list[int] = []

    def simulate(self, number: int, state: Any) -> SolvedCycle:
        self.simulated.append(number)
        after = self._ageing(np.array([1.0, 1.0, 0.0]) if state is None else state)
        if after[0] < self._dies_below:
            raise CycleFailed("empty")
        return SolvedCycle(number, after, after, float(after[0]), NOTHING)


def run(cell: Cell, count: int, needed: tuple[int, ...] = (), tolerance: float | None = 2e-5) -> dict[int, float]:
    runner = CycleRunner(lambda state, vector: vector, None, tolerance)
    return {cycle.number: cycle.capacity_ah for cycle in runner.run(cell.simulate, 1, count, needed)}


@pytest.mark.parametrize(("ageing", "most", "close"), [(film_growth, 80, 1e-4), (late_knee, 60, 6e-4)])
def test_a_few_cycles_tell_the_fade_of_all(ageing: Ageing, most: int, close: float) -> None:
    every = run(Cell(ageing), 400, tolerance=None)
    cell = Cell(ageing)
    some = run(cell, 400)
    assert len(every) == 400
    assert len(cell.simulated) <= most
    assert max(some) == 400
    for number, capacity in some.items():
        assert capacity == pytest.approx(every[number], abs=close), number


def test_cycles_that_are_needed_are_simulated() -> None:
    needed = (1, 40, 41, 200, 333)
    assert set(needed) <= set(run(Cell(film_growth), 400, needed))


def test_cycles_needed_later_lead_no_jump_over_the_end() -> None:
    assert max(run(Cell(film_growth), 15, needed=(16, 31))) == 15


def test_the_number_of_cycles_hardly_grows_with_the_length_of_the_record() -> None:
    counts = []
    for length in (200, 2000):
        cell = Cell(film_growth)
        run(cell, length)
        counts.append(len(cell.simulated))
    assert counts[1] < 3 * counts[0]


def test_a_cell_that_dies_is_found_dead_in_the_same_cycle() -> None:
    every, some = Cell(film_growth, dies_below=0.9), Cell(film_growth, dies_below=0.9)
    for cell, tolerance in ((every, None), (some, 2e-5)):
        with pytest.raises(CycleFailed):
            run(cell, 400, tolerance=tolerance)
    assert some.simulated[-1] == every.simulated[-1]
    assert len(some.simulated) < len(every.simulated)


def test_cycles_without_a_discharge_are_all_simulated() -> None:
    cell = Cell(lambda state: np.zeros(3))
    assert len(run(cell, 30)) == 30


@pytest.mark.parametrize("last_discharge", [12, 13, 16, 20, 60])
def test_no_cycle_is_left_out_where_a_discharge_ends_before_it_begins(last_discharge: int) -> None:
    def simulate(number: int, state: Any) -> SolvedCycle:
        age = np.array([1.0]) if state is None else state + 1.0
        capacity = 2.0 - 0.01 * age[0] if age[0] < last_discharge + 0.5 else 0.0
        return SolvedCycle(number, age, age, float(capacity), NOTHING)

    runner = CycleRunner(lambda state, vector: vector, None)
    found = {cycle.number: cycle.capacity_ah for cycle in runner.run(simulate, 1, 100, (1, 50, 100))}
    assert {number for number, capacity in found.items() if capacity == 0} == set(range(last_discharge + 1, 101))
    assert found[last_discharge] == pytest.approx(2.0 - 0.01 * last_discharge)
