"""Rounds of the agent: free questions first, then one action."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.messages import JsonSchema, Message, Reply
from bsa.core.run.journal import read_events
from bsa.core.run.loop import RunResult
from bsa.core.scaffold import load_scaffold
from bsa_toy_cell import CAPACITY, SERIES, space, toy_scaffold

RunToy = Callable[..., RunResult]


class Scripted:
    """Gives answers in turn, and then the last one again."""

    name, sees_images = "scripted", False

    def __init__(self, *answers: dict[str, Any]) -> None:
        self._answers = list(answers)
        self.schemas: list[JsonSchema] = []
        self.prompts: list[list[Message]] = []

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        self.schemas.append(schema)
        self.prompts.append(list(messages))
        answer = self._answers.pop(0) if len(self._answers) > 1 else self._answers[0]
        return Reply(json.dumps({"analysis": "a", "hypothesis": "h", "rationale": "r", **answer}))

    def close(self) -> None:
        pass


class Answering:
    """Answers each prompt by a function of it."""

    name, sees_images = "answering", False

    def __init__(self, answer: Callable[[Sequence[Message]], dict[str, Any]]) -> None:
        self._answer = answer
        self.prompts: list[list[Message]] = []

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        self.prompts.append(list(messages))
        return Reply(json.dumps(self._answer(messages)))

    def close(self) -> None:
        pass


def proposals(folder: Path) -> list[dict[str, Any]]:
    return [event for event in read_events(folder) if event["event"] == "proposal" and event["phase"] == "search"]


SET = {"action": "set", "updated_params": {CAPACITY: "*1.1"}}


def without_warm_up(name: str = "full") -> Any:
    return toy_scaffold(name).model_copy(update={"warm_up": None})


def test_free_questions_are_answered_in_the_same_round(run_toy: RunToy, tmp_path: Path) -> None:
    backend = Scripted(SET, {"action": "predict"}, {"action": "look", "step": "cc_discharge"}, SET)
    run_toy(tmp_path, scaffold=without_warm_up(), backend=backend, rounds=2, simulations=4)
    first, second = proposals(tmp_path)
    assert "free_actions" not in first["details"]
    assert first["details"]["changed_from"] == 0
    assert second["details"]["free_actions"] == ["predict", "look"]
    assert [message.role for message in backend.prompts[3]] == ["system", *["user", "assistant"] * 2, "user"]
    assert "## Suggested change" in backend.prompts[2][-1].text


@pytest.mark.slow
@pytest.mark.parametrize(("scaffold", "pictures"), [("vision", 1), ("full", 0)])
def test_a_look_has_a_picture_where_the_feedback_has(
    run_toy: RunToy, tmp_path: Path, scaffold: str, pictures: int
) -> None:
    backend = Scripted({"action": "look", "step": "cc_discharge"}, SET)
    run_toy(tmp_path, scaffold=without_warm_up(scaffold), backend=backend, rounds=1, simulations=4)
    images = backend.prompts[1][-1].images
    assert [image.name for image in images] == ["trial-000-cc_discharge.png"] * pictures
    assert all(image.read_bytes().startswith(b"\x89PNG") for image in images)


def test_there_is_an_end_to_free_questions(run_toy: RunToy, tmp_path: Path) -> None:
    backend = Scripted({"action": "look", "step": "cc_discharge"})
    run_toy(tmp_path, scaffold=without_warm_up(), backend=backend, rounds=1, simulations=4)
    assert proposals(tmp_path)[0]["lost"]
    assert "look" not in backend.schemas[-1]["properties"]["action"]["enum"]


def test_what_was_asked_is_simulated_as_it_is(run_toy: RunToy, tmp_path: Path) -> None:
    worse = {"action": "set", "updated_params": {CAPACITY: "*0.9"}}
    result = run_toy(tmp_path, scaffold=without_warm_up(), backend=Scripted(worse), rounds=3, simulations=4)
    assert [trial.candidate[CAPACITY] for trial in result.trials[1:]] == pytest.approx([0.9] * 3)


def test_several_changes_and_differences_are_simulated_at_once(run_toy: RunToy, tmp_path: Path) -> None:
    several = {"action": "simulate", "candidates": [{CAPACITY: "*1.1"}, {CAPACITY: "*1.2"}]}
    backend = Scripted(several, {"action": "jacobian", "params": [SERIES]}, {"action": "jacobian"})
    result = run_toy(tmp_path, scaffold=without_warm_up(), backend=backend, rounds=3, simulations=20)
    assert [event["candidates"] for event in proposals(tmp_path)] == [2, 1, len(space())]
    moved = result.trials[3].candidate
    assert [name for name in moved if moved[name] != result.trials[2].candidate[name]] == [SERIES]
    assert "Last attempt" not in backend.prompts[-1][1].text


@pytest.mark.parametrize(
    ("name", "absent"),
    [
        ("no-history", ["Memory: trials so far"]),
        ("no-sensitivities", ["Memory: learnt sensitivities", '"predict"']),
        ("no-memory", ["## Memory", '"predict"', '"jacobian"']),
        ("digest", ["## Memory", "## Priors"]),
        ("no-reasoning", ["Think first"]),
    ],
)
def test_a_scaffold_leaves_out_what_its_name_says(
    run_toy: RunToy, tmp_path: Path, name: str, absent: list[str]
) -> None:
    backend = Scripted(SET)
    run_toy(tmp_path, scaffold=without_warm_up(name), backend=backend, rounds=3, simulations=6)
    text = "\n".join(message.text for message in backend.prompts[-1])
    assert not [word for word in absent if word in text]
    whole = Scripted(SET)
    run_toy(tmp_path / "full", scaffold=without_warm_up(), backend=whole, rounds=3, simulations=6)
    text = "\n".join(message.text for message in whole.prompts[-1])
    assert not [word for word in absent if word not in text]


@pytest.mark.slow
def test_the_vision_scaffold_explains_its_pictures(run_toy: RunToy, tmp_path: Path) -> None:
    backend = Scripted(SET)
    scaffold = without_warm_up("vision")
    assert load_scaffold("vision").feedback.use == "overlay"
    run_toy(tmp_path, scaffold=scaffold, backend=backend, rounds=1, simulations=3)
    system, user = backend.prompts[-1]
    assert "measured in orange" in system.text
    assert len(user.images) == 1


def test_without_reasons_an_action_is_enough(run_toy: RunToy, tmp_path: Path) -> None:
    backend = Scripted(SET)
    result = run_toy(tmp_path, scaffold=without_warm_up("no-reasoning"), backend=backend, rounds=1, simulations=3)
    assert backend.schemas[-1]["required"] == ["action"]
    assert len(result.trials) == 2


def copying(prompt: Sequence[Message]) -> dict[str, Any]:
    """What a model answers that copies the reply it is shown."""
    found: dict[str, Any] = json.loads(prompt[-1].text.splitlines()[-1])
    return found


def test_a_digest_can_be_followed_by_copying(run_toy: RunToy, tmp_path: Path) -> None:
    backend = Answering(copying)
    result = run_toy(tmp_path, scaffold=toy_scaffold("digest"), backend=backend, rounds=8, simulations=14)
    assert not [event for event in proposals(tmp_path) if event["lost"]]
    assert {event["action"] for event in proposals(tmp_path)} == {"set"}
    warm = min(trial.misfit for trial in result.trials if trial.phase != "search")
    assert min(trial.misfit for trial in result.trials) < 0.2 * warm
    text = backend.prompts[0][-1].text
    assert all(name in text for name in ("worst_features", "suggested_change", "misfit_tolerances"))
    assert not [name for name in ("residuals_along_step", "Memory", "lower") if name in text.partition("## Digest")[0]]


def test_the_rules_follow_a_digest_too(run_toy: RunToy, tmp_path: Path) -> None:
    copied = run_toy(
        tmp_path / "a", scaffold=toy_scaffold("digest"), backend=Answering(copying), rounds=8, simulations=14
    )
    ruled = run_toy(tmp_path / "b", scaffold=toy_scaffold("digest"), backend=RulesBackend(), rounds=8, simulations=14)
    assert [dict(trial.candidate) for trial in ruled.trials] == [dict(trial.candidate) for trial in copied.trials]


def test_a_digest_asks_for_effects_where_changes_fail(run_toy: RunToy, tmp_path: Path) -> None:
    def worse(prompt: Sequence[Message]) -> dict[str, Any]:
        shown = copying(prompt)
        return shown if shown["action"] == "jacobian" else {"action": "set", "updated_params": {CAPACITY: "*0.7"}}

    run_toy(tmp_path, scaffold=toy_scaffold("digest"), backend=Answering(worse), rounds=5, simulations=40)
    assert [event["action"] for event in proposals(tmp_path)] == ["set", "set", "set", "jacobian", "set"]
