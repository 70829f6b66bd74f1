"""Windows of a life, fitted one after the other."""

from collections.abc import Sequence

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.inference.drift import _drift, drifts
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from bsa.core.trajectory import FloatArray

CYCLES = (5, 50, 100, 150, 200)
SPACE = ParameterSpace(
    (
        Parameter("lithium", 1.0, 0.3, 1.3, "log", None, 0.1, True, 0.05),
        Parameter("ohm", 0.01, 0.0, 0.1, "linear", None, 0.02, True, 0.05),
    )
)
SHARE = np.linspace(0.0, 1.0, 60)


def simulate(cycle: int, candidates: Sequence[Candidate]) -> list[FloatArray | None]:
    """Two signatures, a misfit that every window has, and noise; lithium falls by 4 % in 100 cycles."""
    noise = np.random.default_rng(cycle).normal(size=60)
    true = {"lithium": 1.0 - 4e-4 * (cycle - 5), "ohm": 0.01}
    return [
        300.0 * (one["lithium"] - true["lithium"]) * SHARE
        + 5e3 * (one["ohm"] - true["ohm"]) * (1.0 - SHARE)
        + 20.0 * np.sin(9.0 * SHARE)
        + noise
        for one in candidates
    ]


def test_what_drifts_is_told_with_its_trend_and_what_does_not_stays() -> None:
    found = drifts(simulate, CYCLES, SPACE, lambda one: {"lost": 100.0 * (1.0 - one["lithium"]), "ohm": one["ohm"]})
    lost, ohm = found
    assert lost.cycles == CYCLES[1:]
    assert lost.per_100_cycles == pytest.approx(4.0, abs=2.0 * lost.half_per_100_cycles)
    assert lost.half_per_100_cycles < 0.5
    inside = [
        abs(value - 0.04 * (cycle - 5)) < 1.6 * half
        for cycle, value, half in zip(lost.cycles, lost.values, lost.half, strict=True)
    ]
    assert all(inside)
    assert abs(ohm.per_100_cycles) < 2.0 * ohm.half_per_100_cycles


def test_a_window_that_cannot_be_simulated_is_left_out() -> None:
    def broken(cycle: int, candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        return [None] * len(candidates) if cycle == 100 else simulate(cycle, candidates)

    (lost,) = drifts(broken, CYCLES, SPACE, lambda one: {"lost": 100.0 * (1.0 - one["lithium"])})
    assert lost.cycles == (50, 150, 200)


def test_a_first_window_that_cannot_be_simulated_is_an_error_that_says_which() -> None:
    with pytest.raises(BsaError, match="could not be simulated in cycle 5 alone"):
        drifts(lambda cycle, candidates: [None] * len(candidates), CYCLES, SPACE, lambda one: one)


@pytest.mark.parametrize("windows", [3, 5, 8])
def test_the_interval_of_a_trend_holds_it_where_windows_scatter(windows: int) -> None:
    rng = np.random.default_rng(windows)
    cycles = np.linspace(1, 500, windows).astype(int)
    held = 0
    for _ in range(400):
        values = 0.02 * cycles + rng.normal(0.0, 3.0, windows)
        found = _drift("lost", {int(cycle): (value, 1.96) for cycle, value in zip(cycles, values, strict=True)})
        held += abs(found.per_100_cycles - 2.0) <= found.half_per_100_cycles
    assert held / 400 == pytest.approx(0.95, abs=0.04)
