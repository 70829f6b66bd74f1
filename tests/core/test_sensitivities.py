import json
from typing import Any

from bsa.core.sensitivities import Sensitivities
from hypothesis import given
from hypothesis import strategies as st

ANY_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
NAMES = st.text(min_size=1, max_size=12)
EFFECTS = st.dictionaries(NAMES, st.dictionaries(NAMES, st.floats(-1e12, 1e12), min_size=1, max_size=4), max_size=4)


@given(EFFECTS)
def test_what_is_written_is_read_to_three_digits(effects: dict[str, dict[str, float]]) -> None:
    read = Sensitivities.read(json.loads(json.dumps(Sensitivities(effects, "a test").content(10**6))))
    assert read.learnt_from == "a test"
    assert read.effects == {
        name: {feature: float(f"{value:.3g}") for feature, value in rows.items()} for name, rows in effects.items()
    }


@given(ANY_JSON, ANY_JSON)
def test_any_content_is_read(content: Any, effects: Any) -> None:
    for shape in (
        content,
        {"unit": "typical_step", "effects": effects},
        {"unit": "typical_step", "effects": {"a": effects}},
    ):
        for rows in Sensitivities.read(shape).effects.values():
            assert rows
            assert all(isinstance(value, float) and abs(value) <= 1e30 for value in rows.values())


def test_another_unit_is_not_taken_for_a_typical_step() -> None:
    content = Sensitivities({"a": {"f_mv": 1.0}}).content(1000)
    assert Sensitivities.read(content).effects == {"a": {"f_mv": 1.0}}
    assert Sensitivities.read({**content, "unit": "percent"}).effects == {}
    assert Sensitivities.read({"effects": content["effects"]}).effects == {}


def test_a_short_budget_keeps_the_strongest_effect_of_each_parameter() -> None:
    effects = {name: {f"feature_{place}_mv": float(place) for place in range(1, 9)} for name in "abc"}
    content = Sensitivities(effects).content(280)
    assert content["effects"] == {name: {"feature_8_mv": 8.0} for name in "abc"}
    assert len(json.dumps(content)) <= 280
