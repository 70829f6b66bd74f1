import json
from typing import Any

from bsa.core.prompt_sections import (
    FEEDBACK,
    LAST_ATTEMPT,
    PRIORS,
    SENSITIVITIES,
    TASK,
    TRIAL_FEATURES,
    TRIALS,
    read_sections,
    read_table,
)
from bsa.core.sensitivities import Sensitivities
from bsa.plugins.agent.situation import Situation
from bsa_toy_cell import CAPACITY, SERIES, space

from .conftest import MakeSituation


def told(situation: Situation) -> dict[str, Any]:
    return dict(read_sections("\n\n".join(situation.sections())))


def test_each_parameter_stands_once_with_value_step_and_bounds(make_situation: MakeSituation) -> None:
    situation = make_situation()
    columns, rows = read_table(told(situation)[TASK]["parameters"])
    assert columns == ["number", "parameter", "now", "step", "lower", "upper"]
    assert [row[:2] for row in rows] == [[number, name] for number, name in enumerate(space().names, start=1)]
    assert "bounds" not in told(situation)[PRIORS]


def test_the_measured_effects_go_by_the_numbers_of_the_parameters(make_situation: MakeSituation) -> None:
    situation = make_situation()
    effects = told(situation)[SENSITIVITIES]
    assert not any(name in json.dumps(effects) for name in space().names)
    read = Sensitivities.read(effects, tuple(situation.base.feedback.numbers), space().names)
    assert read.effects == situation.sensitivities.effects


def test_without_memories_there_is_nothing_to_number(make_situation: MakeSituation) -> None:
    columns, _ = read_table(told(make_situation(memories=False))[TASK]["parameters"])
    assert columns[0] == "parameter"


def test_the_present_trial_has_the_least_misfit_step_by_step(make_situation: MakeSituation) -> None:
    situation = make_situation()
    assert situation.base.misfit == min(trial.misfit for trial in situation.context.trials)
    feedback = told(situation)[FEEDBACK]
    assert feedback["misfit_tolerances"] == float(f"{situation.base.misfit:.4g}")
    assert feedback["simulations_left"] == 9


def test_the_score_is_seen_step_by_step(make_situation: MakeSituation) -> None:
    feedback = told(make_situation())[FEEDBACK]
    columns, rows = read_table(feedback["steps"])
    discharge = dict(zip(columns, next(row for row in rows if row[0] == "cc_discharge"), strict=True))
    assert discharge["simulated_s"] - discharge["measured_s"] == discharge["clock_offset_at_end_s"]
    shares = [row[place] for row in rows for place, name in enumerate(columns) if "share" in name]
    assert 95.0 < sum(shares) < 105.0
    columns, rows = read_table(feedback["residuals_along_step"])
    assert 8 <= len(columns) - 2 <= 10
    assert rows[0][:2] == ["cc_discharge", "voltage_mv"]


def test_what_was_clipped_is_said(make_situation: MakeSituation) -> None:
    feedback = told(make_situation(clipped=(SERIES,)))[FEEDBACK]
    assert feedback["clipped_at_their_bounds_in_the_last_change"] == [SERIES]


def test_the_latest_attempt_is_told_once(make_situation: MakeSituation) -> None:
    sections = told(make_situation())
    assert LAST_ATTEMPT not in sections
    situation = make_situation()
    latest = situation.context.trials[-1].index
    assert len(sections[TRIALS][TRIAL_FEATURES][f"trial_{latest}"]) == len(situation.base.feedback.numbers)
    attempt = told(make_situation(memories=False))[LAST_ATTEMPT]
    assert set(attempt["changed_by_steps"]) >= {CAPACITY, SERIES}
    assert len(attempt[TRIAL_FEATURES]) > 3


def test_without_memory_there_are_neither_trials_nor_effects(make_situation: MakeSituation) -> None:
    situation = make_situation(memories=False)
    assert not situation.remembers
    assert not situation.sensitivities.effects
    assert not {TRIALS, SENSITIVITIES} & set(told(situation))


def test_one_number_as_feedback_is_all_that_is_told(make_situation: MakeSituation) -> None:
    situation = make_situation("scalar")
    assert situation.base is situation.context.best
    text = "\n".join(situation.sections())
    for word in ("misfit", "measured_s", "simulated_s", "clock", "cc_discharge", "duration", "features"):
        assert word not in text, word
    assert set(told(situation)[FEEDBACK]) == {"trial", "simulations_left", "residuals"}
