"""Steps that a model of the residuals leads: how far they reach, and when the model is asked no more."""

import numpy as np
from bsa.core.inference.guided_steps import GuidedSteps
from bsa.core.trajectory import FloatArray

HERE, THERE = np.zeros(2), np.array([0.2, -0.1])


class Promising(GuidedSteps):
    """Promises ten as far as it may go; knows nothing where it is told so."""

    knows = True
    least_share = 0.1

    def derivatives(self, point: FloatArray) -> FloatArray:
        return np.zeros((1, len(point)))

    def _least(self, point: FloatArray, residual: FloatArray, cost: float) -> tuple[FloatArray, float] | None:
        return (point + self._reach, 10.0) if self.knows else None

    def _mispredicted(self, residual: FloatArray | None, gained: float) -> bool:
        return gained <= 0


def asked(steps: GuidedSteps, cost: float = 20.0, worth: float = 1.0) -> FloatArray | None:
    return steps.next(HERE, np.ones(1), cost, worth)


def told(steps: GuidedSteps, gained: float, cost: float = 20.0) -> None:
    steps.judge(HERE, THERE, np.ones(1), gained, cost, worth=1.0)


def test_what_is_promised_must_be_worth_a_simulation() -> None:
    steps = Promising(0.5, patience=2)
    there = asked(steps, worth=9.0)
    assert there is not None
    assert np.all(there == 0.5)
    assert asked(steps, worth=11.0) is None
    assert steps.expects, "it was asked, and promised too little"
    assert steps.promised == 10.0


def test_after_so_many_failures_in_a_row_it_is_asked_no_more() -> None:
    steps = Promising(0.5, patience=2)
    for gained in (-1.0, 5.0, 1.9, 1.9):
        assert asked(steps) is not None
        told(steps, gained)
    # A fifth of ten is two.
    assert asked(steps) is None
    assert not steps.expects
    assert steps.at_once(HERE, np.ones(1), 20.0, 1.0) is not None
    steps.begin_anew()
    assert asked(steps) is not None


def test_a_step_must_gain_its_share_of_the_cost() -> None:
    steps = Promising(0.5, patience=1)
    assert asked(steps, cost=60.0) is not None
    told(steps, 5.0, cost=60.0)
    assert asked(steps, cost=60.0) is None


def test_steps_get_shorter_where_one_mispredicted_and_longer_again_up_to_the_radius() -> None:
    steps = Promising(0.5, patience=9)
    reaches = []
    for gained in (-1.0, 5.0, 5.0, 5.0):
        told(steps, gained)
        there = asked(steps)
        assert there is not None
        reaches.append(float(there[0]))
    assert reaches == [0.1, 0.2, 0.4, 0.5], "half of the longest coordinate of the step, then twice as far each time"


def test_a_model_that_cannot_tell_leads_nowhere() -> None:
    steps = Promising(0.5, patience=2)
    steps.knows = False
    assert asked(steps) is None
    assert not steps.expects
