"""Whatever a plugin writes under a heading that the rules know, they answer."""

import copy
import json
from typing import Any

import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.backends.rules.reading import read_prompt
from bsa.core.feedback import Feedback
from bsa.core.messages import Message
from bsa.core.prompt_sections import (
    DIGEST,
    FEEDBACK,
    LAST_ATTEMPT,
    NUMERICS,
    PRIORS,
    SENSITIVITIES,
    TASK,
    TRIALS,
    section,
    table,
)
from bsa.core.sensitivities import Sensitivities
from hypothesis import example, given
from hypothesis import strategies as st

A, B = "Capacity [A.h]", "Initial state of charge"
FEATURES = {"cc_discharge_time_mismatch_s": -600.0}
SECTIONS: dict[str, Any] = {
    TASK: {
        "parameters": table(
            ["parameter", "now", "step", "lower", "upper"],
            [[A, 1.0, "*1.1", 0.5, 3.0], [B, 0.5, "+0.05", 0.0, 1.0]],
        )
    },
    PRIORS: {
        "rules": table(
            ["raises", "lowers", "parameters_and_why"], [["discharge_time", "polarisation", [["Capacity", "why"]]]]
        )
    },
    TRIALS: {
        "trials": table(
            ["trial", "asked_by", "steps_from_present"], [[1, "search", [1.0, 0.5]], [2, "search", [1.2, -0.6]]]
        ),
        "features_in_the_order_of_the_feedback": {"trial_1": [-500.0]},
    },
    SENSITIVITIES: Sensitivities({A: {"cc_discharge_time_mismatch_s": 300.0}}).content(1000),
    FEEDBACK: {"trial": 3, "simulations_left": 9, **Feedback({"features": FEATURES, "tolerances": FEATURES}).told()},
    LAST_ATTEMPT: {"trial": 4, "changed_by_steps": {A: 1.0}},
    NUMERICS: {
        "status": "descending",
        "misfit_tolerances_by_round": [10.0, 9.9, 9.8, 9.8, 9.7, 9.7],
        "simulations_you_may_spend": 3,
        "your_last_actions": [{"action": "reduce"}],
        "the_record": {"leaves_open": [B], "narrows": [], "only_together": [[A, B]]},
    },
}
SCHEMAS = [
    {"properties": {"updated_params": {}}},
    {"properties": {"action": {"enum": ["set", "jacobian"]}}},
    {"properties": {"action": {"enum": ["set", "refine"]}}},
    {"properties": {"perturbations": {"maxItems": 3}}},
]

NUMBERS = st.integers() | st.floats() | st.sampled_from([0, -1, 1e-300, 1e300, 10**400, float("nan"), float("inf")])
ANY_JSON = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(max_size=6) | st.sampled_from([A, B, "*1e300", "+1e-300", "done"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from([A, B, "x"]), inner, max_size=3),
    max_leaves=8,
)


def places(content: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The path of every part of a JSON value."""
    inner = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    return [path, *(found for key, value in inner for found in places(value, (*path, key)))]


def replaced(content: Any, path: tuple[Any, ...], value: Any) -> Any:
    if not path:
        return value
    copied = copy.copy(content)
    copied[path[0]] = replaced(content[path[0]], path[1:], value)
    return copied


def conversation(sections: list[tuple[str, Any]]) -> list[Message]:
    return [Message("user", "\n\n".join(section(heading, content) for heading, content in sections))]


def answer(messages: list[Message]) -> None:
    for schema in SCHEMAS:
        assert isinstance(json.loads(RulesBackend().complete(messages, schema, seed=0).text), dict)


@pytest.mark.slow
@given(st.sampled_from([(heading, path) for heading in SECTIONS for path in places(SECTIONS[heading])]), ANY_JSON)
@example((NUMERICS, ("status",)), "done")
@example((SENSITIVITIES, ("effects", "rows")), [[A, 1, 0.0, 1e300]])
@example((FEEDBACK, ("features", "rows")), True)
def test_any_part_of_any_section_may_be_anything(place: tuple[str, tuple[Any, ...]], value: Any) -> None:
    heading, path = place
    answer(conversation(list((SECTIONS | {heading: replaced(SECTIONS[heading], path, value)}).items())))


@pytest.mark.slow
@given(st.sampled_from(sorted(SECTIONS)), ANY_JSON)
def test_a_memory_under_a_known_heading_may_say_anything(heading: str, content: Any) -> None:
    sections = list(SECTIONS.items())
    messages = conversation([sections[0], (heading, content), *sections[1:]])
    answer(messages)
    prompt = read_prompt(messages)
    assert list(prompt.parameters) == [A, B]
    assert prompt.features == FEATURES


def test_what_does_not_nest_sanely_is_passed_over() -> None:
    text = f"## {TRIALS}\n```json\n{'[' * 100_000}\n```"
    answer([Message("user", text)])


@pytest.mark.parametrize("known", [A, B])
def test_a_parameter_without_a_measured_effect_goes_by_the_rules_of_thumb(known: str) -> None:
    from bsa.backends.rules.sensitivity import infer

    measured = Sensitivities({known: {"cc_discharge_time_mismatch_s": 7.0}}).content(1000)
    sections = {TASK: SECTIONS[TASK], PRIORS: SECTIONS[PRIORS], SENSITIVITIES: measured, FEEDBACK: SECTIONS[FEEDBACK]}
    slopes = dict(zip((A, B), infer(read_prompt(conversation(list(sections.items())))).slopes[0], strict=True))
    assert slopes[known] == 7.0
    assert slopes[A] > 0


def test_the_record_may_name_parameters_by_their_numbers() -> None:
    told = {
        **SECTIONS,
        NUMERICS: {"the_record": {"leaves_open": [2, B, 7, None], "narrows": [1], "only_together": [[1, 2]]}},
    }
    record = read_prompt(conversation(list(told.items()))).numerics.record
    assert record is not None
    assert (record.leaves_open, record.narrows, record.only_together) == ((B, B, "7"), (A,), ((A, B),))


@pytest.mark.parametrize("suggested", [{}, [], {A: 3.0}, {A: "*1.1"}])
def test_a_digest_is_followed_where_it_suggests_something(suggested: Any) -> None:
    digest = {DIGEST: {"suggested_change": suggested}}
    found = read_prompt(conversation(list((SECTIONS | digest).items()))).suggested
    assert found == ({A: "*1.1"} if suggested == {A: "*1.1"} else {})
