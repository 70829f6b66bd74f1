from dataclasses import replace

import numpy as np
import pytest
from bsa.core.prompt_sections import read_sections, read_table
from bsa.plugins.agent.actions import Action
from bsa.plugins.agent.free_actions import answer, steps_to_look_at
from bsa.plugins.agent.linear_advice import as_factors, digest, suggested
from bsa.plugins.agent.updates import apply_updates
from bsa_toy_cell import CAPACITY

from .conftest import MakeSituation


def test_a_prediction_adds_the_measured_effects(make_situation: MakeSituation) -> None:
    situation = make_situation()
    moved = {**situation.base.candidate, CAPACITY: 1.1 * situation.base.candidate[CAPACITY]}
    ((_, content),) = read_sections(answer(Action("predict", (moved,)), situation))
    columns, rows = read_table(content["prediction"])
    row = dict(zip(columns, next(row for row in rows if row[0] == "cc_discharge_time_mismatch_s"), strict=True))
    effect = situation.sensitivities.effects[CAPACITY]["cc_discharge_time_mismatch_s"]
    assert row["predicted"] - row["now"] == pytest.approx(effect, rel=0.01)


def test_a_prediction_of_nothing_is_the_change_that_the_effects_suggest(make_situation: MakeSituation) -> None:
    situation = make_situation()
    ((_, content),) = read_sections(answer(Action("predict"), situation))
    assert content["updated_params"] == suggested(situation)
    assert float(content["updated_params"][CAPACITY].removeprefix("*")) > 1.0
    _, rows = read_table(content["prediction"])
    assert sum((after / tolerance) ** 2 for _, _, after, tolerance in rows) < 0.1 * sum(
        (now / tolerance) ** 2 for _, now, _, tolerance in rows
    )


def test_a_look_shows_measured_beside_simulated(make_situation: MakeSituation) -> None:
    situation = make_situation()
    assert "cc_discharge" in steps_to_look_at(situation)
    ((_, content),) = read_sections(answer(Action("look", step="cc_discharge"), situation))
    columns, rows = read_table(content["voltage"])
    assert columns == ["at_pct", "measured_V", "simulated_V", "residual_mV"]
    assert all(value == round(value, 6) for row in rows for value in row)
    for _, measured, simulated, residual in rows:
        assert 1e3 * (simulated - measured) == pytest.approx(residual, abs=0.3)


def test_nothing_can_be_seen_or_predicted_where_one_number_is_told(make_situation: MakeSituation) -> None:
    assert steps_to_look_at(make_situation("scalar")) == ()
    assert suggested(make_situation(memories=False)) == {}


def test_a_digest_names_the_worst_features_and_what_lowers_them(make_situation: MakeSituation) -> None:
    situation = make_situation()
    content = digest(situation, suggested(situation))
    columns, rows = read_table(content["worst_features"])
    assert len(rows) == 3
    worst = dict(zip(columns, rows[0], strict=True))
    assert worst["feature"] == "cc_discharge_time_mismatch_s"
    assert worst["what_lowers_it_most"][0] == f"raise {CAPACITY}"
    assert content["suggested_change"]


def test_a_suggestion_is_shorter_than_what_was_no_better(make_situation: MakeSituation) -> None:
    situation = make_situation()

    def length(failed: tuple[float, ...]) -> float:
        told = replace(situation, failed=failed)
        base = situation.base.candidate
        there = apply_updates(suggested(told), situation.task.space, base)[0]
        return float(np.linalg.norm(situation.task.space.steps_between(base, there)))

    assert length(()) > 1.0
    assert length((2.0, 1.0)) == pytest.approx(0.4, rel=0.1)
    assert length((0.1,)) == pytest.approx(0.04, rel=0.1)


def test_what_is_to_be_copied_has_one_notation() -> None:
    change = {"a": "*1.1", "b": "-0.03", "c": "+0.01", "d": "+0.02"}
    base = {"a": 1.0, "b": 0.3, "c": -0.03, "d": 0.0}
    assert as_factors(change, base) == {"a": "*1.1", "b": "*0.9", "c": "+0.01", "d": "+0.02"}
