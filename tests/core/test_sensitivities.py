import json
from typing import Any

import numpy as np
import pytest
from bsa.core.prompt_sections import numbered
from bsa.core.sensitivities import Sensitivities, linear_change
from hypothesis import given
from hypothesis import strategies as st

ANY_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
COLUMNS = ["parameter", "points", "misprediction_pct", "effects"]
NAMES = st.text(min_size=1, max_size=12)
EFFECTS = st.dictionaries(NAMES, st.dictionaries(NAMES, st.floats(-1e12, 1e12), min_size=1, max_size=4), max_size=4)


@given(EFFECTS)
def test_what_is_written_is_read_to_three_digits_and_whole_from_ten_on(effects: dict[str, dict[str, float]]) -> None:
    read = Sensitivities.read(json.loads(json.dumps(Sensitivities(effects, "a test").content(10**6))))
    assert read.learnt_from == "a test"
    assert {name: set(rows) for name, rows in read.effects.items()} == {n: set(rows) for n, rows in effects.items()}
    for name, rows in effects.items():
        for feature, value in rows.items():
            largest = max(abs(other.get(feature, 0.0)) for other in effects.values())
            digits = 5.1e-3 * abs(value) if abs(value) < 9.99 else 0.5 + 5.1e-3 * abs(value)
            assert abs(read.effects[name][feature] - value) <= digits + 1e-4 * largest + 1e-322


@given(ANY_JSON, ANY_JSON)
def test_any_content_is_read(content: Any, effects: Any) -> None:
    for shape in (
        content,
        {"unit": "typical_step", "effects": effects},
        {"unit": "typical_step", "effects": {"columns": COLUMNS, "rows": [["a", 1, 0.0, effects]]}},
    ):
        for rows in Sensitivities.read(shape).effects.values():
            assert rows
            assert all(isinstance(value, float) and abs(value) <= 1e30 for value in rows.values())


def test_another_unit_is_not_taken_for_a_typical_step() -> None:
    content = Sensitivities({"a": {"f_mv": 1.0}}).content(1000)
    assert Sensitivities.read(content).effects == {"a": {"f_mv": 1.0}}
    assert Sensitivities.read({**content, "unit": "percent"}).effects == {}
    assert Sensitivities.read({"effects": content["effects"]}).effects == {}


def test_a_short_budget_keeps_the_strongest_feature() -> None:
    effects = {name: {f"feature_{place}_mv": float(place) for place in range(1, 9)} for name in "abc"}
    content = Sensitivities(effects).content(285)
    assert content["effects_on"] == ["feature_8_mv"]
    assert Sensitivities.read(content).effects == {name: {"feature_8_mv": 8.0} for name in "abc"}
    assert len(json.dumps(content)) <= 285


def test_a_shorter_budget_keeps_the_strongest_parameter() -> None:
    effects = {name: {"feature_mv": float(size)} for size, name in enumerate("abc", start=1)}
    content = Sensitivities(effects).content(238)
    assert Sensitivities.read(content).effects == {"c": {"feature_mv": 3.0}}
    assert len(json.dumps(content)) <= 238


def test_names_that_the_feedback_lists_do_not_stand_twice() -> None:
    learnt = Sensitivities({"a": {"f_mv": 1.5}, "b": {"g_s": 250.4, "f_mv": -2.0}})
    content = learnt.content(1000, ("g_s", "f_mv"))
    assert "g_s" not in json.dumps(content)
    read = Sensitivities.read(json.loads(json.dumps(content)), ("g_s", "f_mv"))
    assert read.effects == {"a": {"f_mv": 1.5}, "b": {"g_s": 250.0, "f_mv": -2.0}}
    assert Sensitivities.read(content, ("g_s",)).effects == {}
    assert set(learnt.content(1000, ("f_mv",))["effects_on"]) == {"f_mv", "g_s"}


def test_rows_may_go_by_the_numbers_of_the_parameters() -> None:
    learnt = Sensitivities({"a": {"f": 1.0}, "b": {"f": 2.0}})
    content = numbered(learnt.content(1000), ("b", "a"))
    assert [row[0] for row in content["effects"]["rows"]] == [2, 1]
    assert Sensitivities.read(content, parameters=("b", "a")).effects == learnt.effects
    assert set(Sensitivities.read(content).effects) == {"1", "2"}


def test_what_is_the_same_of_all_parameters_stands_once() -> None:
    learnt = Sensitivities({"a": {"f": 1.0}, "b": {"f": 2.0}}, points={"a": 3, "b": 3}, misprediction_pct={"a": 5.0})
    content = learnt.content(1000)
    assert content["points"] == 3
    assert content["effects"]["columns"] == ["parameter", "misprediction_pct", "effects"]
    assert Sensitivities.read(content).effects == learnt.effects


def test_a_prediction_adds_effects_up_and_the_linear_change_undoes_a_mismatch() -> None:
    learnt = Sensitivities({"a": {"f": 2.0, "g": 1.0}, "b": {"g": -3.0}})
    assert learnt.predicted({"f": 4.0, "g": 0.0}, {"a": -2.0, "b": 1.0, "unknown": 5.0}) == {"f": 0.0, "g": -5.0}
    slopes = learnt.slopes(["a", "b"], ["f", "g"])
    far, mismatch = np.full(2, 9.0), np.array([4.0, 0.0])
    change = linear_change(slopes, mismatch, np.ones(2), -far, far, 9.0)
    assert slopes @ change == pytest.approx(-mismatch, abs=0.01)
    assert np.linalg.norm(linear_change(slopes, mismatch, np.ones(2), -far, far, 0.5)) <= 0.5 + 1e-9
