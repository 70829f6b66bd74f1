import threading
import time
from functools import partial

import discovery_toy as toy
import numpy as np
import pytest
from bsa.core.discovery.engine import Engine
from bsa.core.inference.side_by_side import side_by_side


@pytest.mark.parametrize("at_once", [1, 3])
def test_answers_come_in_order_and_all_actions_run(at_once):
    def action(number):
        time.sleep(0.01 * (5 - number))
        return number, threading.current_thread() is threading.main_thread()

    found = side_by_side([partial(action, number) for number in range(5)], at_once)
    assert [number for number, _ in found] == list(range(5))
    assert all(alone is (at_once == 1) for _, alone in found)


def test_the_first_failure_is_raised_and_those_not_begun_are_left_out():
    begun = []

    def action(number):
        begun.append(number)
        time.sleep(0.05)
        raise ValueError(number)

    with pytest.raises(ValueError, match="0"):
        side_by_side([partial(action, number) for number in range(50)], 2)
    time.sleep(0.2)
    assert len(begun) < 10


@pytest.mark.slow
def test_a_discovery_finds_the_same_with_threads():
    def run(at_once):
        problem, space = toy.problem(np.random.default_rng(0), {"quadratic": 0.01, "sign": 0.015})
        problem.simulator.at_once = at_once
        findings = Engine(problem, space, (toy.QUADRATIC, toy.HYSTERESIS, toy.SLOW), toy.EVIDENCE).run()
        return findings.verdict, [(e.label, tuple(e.fit.u), e.held_rmse_v) for e in findings.explanations]

    assert run(4) == run(1)
