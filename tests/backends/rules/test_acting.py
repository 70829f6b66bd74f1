from typing import Any

import pytest
from bsa.backends.rules.acting import act
from bsa.backends.rules.numerics import Numerics
from bsa.backends.rules.reading import Prompt
from bsa.core.sensitivities import Sensitivities


def prompt(**numerics: Any) -> Prompt:
    return Prompt(
        parameters={"a": 1.0, "b": 2.0},
        steps={"a": "*1.1", "b": "*1.1"},
        features={"discharge_time_s": 100.0},
        sensitivities=Sensitivities({"a": {"discharge_time_s": 50.0}}),
        numerics=Numerics.read({"simulations_you_may_spend": 3, **numerics}),
    )


def test_a_fit_that_gets_on_is_left_alone() -> None:
    answer = act(prompt(status="descending", misfit_tolerances_by_round=[100.0, 60.0, 30.0, 20.0, 10.0]))
    assert answer["action"] == "refine"
    assert "refine_params" not in answer


def test_a_fit_that_is_slow_gets_a_hand_and_then_is_left_alone_again() -> None:
    slow = {"status": "descending", "misfit_tolerances_by_round": [10.0, 9.9, 9.8, 9.8, 9.8, 9.7]}
    answer = act(prompt(**slow))
    assert answer["action"] == "set"
    assert list(answer["updated_params"]) == ["a"]
    assert act(prompt(**slow, your_last_actions=[{"action": "set"}]))["action"] == "refine"


@pytest.mark.parametrize("status", ["infeasible", "done"])
def test_trouble_is_eased_first(status: str) -> None:
    assert act(prompt(status=status))["action"] == "reduce"


def test_after_the_end_it_tries_in_turn_and_then_gives_up() -> None:
    tried: list[dict[str, str]] = []
    for _ in range(8):
        answer = act(prompt(status="done", misfit_tolerances_by_round=[20.0], your_last_actions=tried[-5:]))
        tried.append({"action": answer["action"]})
    kinds = [entry["action"] for entry in tried]
    assert kinds[:3] == ["reduce", "jacobian", "set"]
    assert "refine" in kinds


def test_it_says_what_the_record_fixes() -> None:
    record = {"leaves_open": ["b"], "narrows": [], "only_together": [["a", "b"]]}
    words = act(prompt(status="descending", misfit_tolerances_by_round=[9.0], the_record=record))["analysis"]
    assert "The record fixes 1 of 2 parameters here, leaves open b, and moves a with b only together." in words
    assert "record" not in act(prompt(status="descending", misfit_tolerances_by_round=[9.0]))["analysis"]
