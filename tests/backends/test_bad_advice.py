import json

import pytest
from bsa.backends.bad_advice import AdversarialAdvice, RandomAdvice
from bsa.plugins.agent.actions import Offer, action_schema, check_action
from bsa_toy_cell import toy_task

SPACE = toy_task().space
ALONE = Offer(("set", "simulate", "jacobian"), SPACE)
BESIDE = Offer(("refine", "set", "jacobian", "restart", "reduce"), SPACE, drives=True)


@pytest.mark.parametrize("backend", [RandomAdvice(), AdversarialAdvice()], ids=lambda backend: backend.name)
def test_bad_advice_is_well_formed_and_differs_by_seed_alone(backend: RandomAdvice | AdversarialAdvice) -> None:
    replies = [backend.complete([], action_schema(BESIDE), seed=seed).text for seed in range(20)]
    assert replies == [backend.complete([], action_schema(BESIDE), seed=seed).text for seed in range(20)]
    assert len(set(replies)) > 10
    for text in replies:
        reply = json.loads(text)
        if reply["action"] not in ("restart", "set") or ("updated_params" in reply and reply["action"] == "set"):
            check_action(reply, BESIDE, SPACE.initial, [])
    reply = json.loads(backend.complete([], action_schema(ALONE), seed=1).text)
    assert reply["action"] in ALONE.kinds


def test_the_adversary_asks_for_corners() -> None:
    reply = json.loads(AdversarialAdvice().complete([], action_schema(BESIDE), seed=3).text)
    action = check_action(reply, BESIDE, SPACE.initial, [])
    assert action.kind == "set"
    assert action.simulations == 40
    assert action.candidates
    assert all(action.candidates[0][p.name] in (p.lower, p.upper) for p in SPACE)
