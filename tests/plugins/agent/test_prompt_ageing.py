"""What the agent is told and may ask on a life of hundreds of cycles."""

from collections.abc import Sequence

import pytest
from bsa.core.comparison.residuals import residuals
from bsa.core.feedback import Feedback
from bsa.core.hooks import ProposeContext, Recollection, RunContext
from bsa.core.messages import JsonSchema, Message, Reply, Usage
from bsa.core.metrics import evaluate
from bsa.core.prompt_sections import CYCLES, TASK, read_sections
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import Task
from bsa.core.trial import Trial
from bsa.plugins.agent.actions import Offer, action_schema, check_action
from bsa.plugins.agent.proposer import AgentOptions, AgentProposer
from bsa.plugins.feedback.structured import StructuredFeedback
from bsa_toy_cell import space
from bsa_toy_life import life, life_task


class Scripted:
    """Answers what it is told to, and keeps what it was asked."""

    name = "scripted"
    sees_images = False

    def __init__(self, *replies: str) -> None:
        self._replies = list(replies)
        self.asked: list[str] = []
        self.system = ""

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        self.system, self.asked = messages[0].text, [*self.asked, messages[-1].text]
        return Reply(self._replies.pop(0), Usage(), model="scripted", structured_by="schema")

    def close(self) -> None:
        pass


def situation(task: Task, context: RunContext) -> ProposeContext:
    count = len(task.experiments[0].protocol or ())
    outcome = Outcome((ExperimentRun(life(count, 0.1)),))
    metrics = evaluate(task, outcome)
    feedback: Feedback = StructuredFeedback(None, context).build_feedback(outcome, metrics, 0)
    curves = tuple(run.trajectory for run in outcome.runs)
    found = residuals(task, outcome)
    trial = Trial(0, "initial", 0, space().initial, metrics, None, found, feedback, curves, 1.0)

    def recall(budget: int) -> list[Recollection]:
        return []

    return ProposeContext(task, 1, (trial,), trial, 1, 50, recall)


@pytest.fixture
def asked(tmp_path) -> Scripted:  # type: ignore[no-untyped-def]
    """A backend that was asked twice; the first reply asks for cycle 40."""
    action = '{"analysis": "a", "hypothesis": "h", "action": "set", "updated_params": {"Capacity [A.h]": "*1.1"}, '
    backend = Scripted(action + '"look_at": [40, 999], "rationale": "r"}', action + '"rationale": "r"}')
    task = life_task(life(200, 0.2))
    context = RunContext(task, 1, tmp_path, backend, 1)
    proposer = AgentProposer(AgentOptions(free_actions=0), context)
    for _ in range(2):
        assert not proposer.propose(situation(task, context)).lost
    return backend


def test_a_life_is_told_by_its_fade_and_one_line_of_protocol(asked: Scripted) -> None:
    told = dict(read_sections(asked.asked[0]))[TASK]
    [record] = told["records"]
    assert record["protocol"]["times"] == 200
    assert record["measured"]["cycles"] == 200
    assert record["measured"]["capacity_ah"][0] == 1.0
    assert len(asked.asked[0]) < 16_000
    assert "knee" in asked.system
    assert "look_at" in asked.asked[0]


def test_the_cycles_asked_for_are_shown_in_the_next_round(asked: Scripted) -> None:
    def shown(text: str) -> dict[int, str]:
        [record] = dict(read_sections(text))[CYCLES]["records"]
        return {entry["cycle"]: entry["shown_because"] for entry in record["cycles"]}

    first, second = (shown(text) for text in asked.asked)
    assert first[1] == "first"
    assert "last" in first[200]
    assert not any("asked" in reason for reason in first.values())
    assert "asked for (40)" in second[38]


def test_cycles_can_be_asked_for_of_long_records_alone() -> None:
    offer = Offer(("set",), space(), cycles=200)
    assert action_schema(offer)["properties"]["look_at"]["items"]["maximum"] == 200
    assert "look_at" not in action_schema(Offer(("set",), space()))["properties"]
    content = {"action": "set", "updated_params": {"Capacity [A.h]": "*1.1"}, "look_at": [1, "x", 0, 201, 40.0, None]}
    assert check_action(content, offer, space().initial, []).look_at == (1, 40)
    assert check_action({**content, "look_at": "all"}, offer, space().initial, []).look_at == ()
