import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bsa.core.feedback import Feedback
from bsa.core.hooks import NoOptions, RunContext
from bsa.core.metrics import evaluate
from bsa.core.parameters import ParameterSpace
from bsa.core.prompt_sections import read_table
from bsa.core.proposal import Proposal
from bsa.core.sensitivities import Sensitivities
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task_reduction import TaskReduction
from bsa.core.trial import Phase, Trial, closest
from bsa.plugins.feedback.structured import StructuredFeedback
from bsa.plugins.memory.history import HistoryMemory, HistoryOptions
from bsa.plugins.memory.priors import Priors
from bsa.plugins.memory.sensitivities import SensitivityMemory
from bsa_toy_cell import CAPACITY, SERIES, record, space, toy_task


@pytest.fixture
def context(tmp_path: Path) -> RunContext:
    return RunContext(toy_task(), 1, tmp_path)


def trial(context: RunContext, index: int, phase: Phase, candidate: dict[str, float], fails: bool = False) -> Trial:
    failure = SimulationFailure("gave up") if fails else None
    outcome = Outcome((ExperimentRun(None if fails else record(candidate), failure),))
    metrics = evaluate(context.task, outcome)
    feedback = StructuredFeedback(NoOptions(), context).build_feedback(outcome, metrics, index)
    return Trial(index, phase, 1, candidate, metrics, failure, None, feedback, (), 0.0)


def learnt(memory: SensitivityMemory, content: Mapping[str, Any]) -> Sensitivities:
    """As it is read beside the feedback of the closest trial."""
    return Sensitivities.read(content, tuple(closest(memory._good).feedback.numbers))


def test_the_rules_say_what_one_typical_step_does(context: RunContext) -> None:
    memory = SensitivityMemory(NoOptions(), context)
    memory.remember(trial(context, 0, "initial", space().initial), None)
    rng = np.random.default_rng(3)
    for index in range(1, 13):
        values = {name: value * float(np.exp(0.05 * rng.standard_normal())) for name, value in space().initial.items()}
        memory.remember(trial(context, index, "warm-up", values), None)
    recollection = memory.recall(9000)
    assert recollection is not None
    effects = learnt(memory, recollection.content).effects
    step = record({**space().initial, CAPACITY: 1.1}).duration - record(space().initial).duration
    assert effects[CAPACITY]["cc_discharge_time_mismatch_s"] == pytest.approx(step, rel=0.1)
    assert effects[SERIES]["cc_discharge_early_shift_mv"] < 0
    assert effects[CAPACITY]["cc_discharge_time_mismatch_s"] > 0


def test_a_small_budget_keeps_the_strongest_effects(context: RunContext) -> None:
    memory = SensitivityMemory(NoOptions(), context)
    memory.remember(trial(context, 0, "initial", space().initial), None)
    for index, name in enumerate(space().names, start=1):
        memory.remember(trial(context, index, "warm-up", {**space().initial, name: space().initial[name] * 1.1}), None)
    whole, short = memory.recall(9000), memory.recall(600)
    assert whole is not None
    assert short is not None
    assert len(json.dumps(short.content)) < len(json.dumps(whole.content))
    assert "cc_discharge_time_mismatch_s" in learnt(memory, short.content).effects[CAPACITY]


def test_failures_are_told_and_too_little_gives_no_rule(context: RunContext) -> None:
    memory = SensitivityMemory(NoOptions(), context)
    assert memory.recall(9000) is None
    memory.remember(trial(context, 0, "initial", space().initial), None)
    for index, factor in enumerate((1.1, 0.9, 1.2), start=1):
        memory.remember(trial(context, index, "warm-up", {**space().initial, CAPACITY: factor}), None)
    memory.remember(trial(context, 9, "warm-up", {**space().initial, SERIES: 0.4}, fails=True), None)
    recollection = memory.recall(9000)
    assert recollection is not None
    assert recollection.content["made_the_simulation_fail"] == [f"{SERIES} 0.4: gave up"]


def rows(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    columns, found = read_table(content["trials"])
    return [dict(zip(columns, row, strict=True)) for row in found]


def test_history_keeps_the_best_and_the_latest_within_its_budget(context: RunContext) -> None:
    memory = HistoryMemory(HistoryOptions(rounds=6), context)
    for index in range(20):
        memory.remember(trial(context, index, "search", {**space().initial, CAPACITY: 1.3 + 0.02 * index}), None)
    recollection = memory.recall(100_000)
    assert recollection is not None
    assert [row["trial"] for row in rows(recollection.content)] == [0, 1, 2, 17, 18, 19]
    small = memory.recall(900)
    assert small is not None
    assert len(json.dumps(small.content)) <= 900 or len(rows(small.content)) == 1


def test_of_many_parameters_fewer_trials_are_shown(context: RunContext) -> None:
    one = next(iter(space()))
    many = ParameterSpace([replace(one, name=f"Parameter {number} [A.h]") for number in range(24)])
    memory = HistoryMemory(HistoryOptions(), replace(context, task=replace(context.task, space=many)))
    for index in range(8):
        values = dict.fromkeys(many.names, one.initial * (1.0 + 0.01 * index))
        memory.remember(replace(trial(context, index, "search", space().initial), candidate=values), None)
    recollection = memory.recall(100_000)
    assert recollection is not None
    assert len(rows(recollection.content)) == 3


def test_history_shows_the_warm_up_failures_and_who_asked(context: RunContext) -> None:
    memory = HistoryMemory(HistoryOptions(), context)
    memory.remember(trial(context, 0, "initial", space().initial), None)
    memory.remember(trial(context, 1, "warm-up", {**space().initial, CAPACITY: 1.3}), None)
    both = Proposal((), hypothesis="h", details={"authors": ["fit", "agent"]})
    memory.remember(trial(context, 2, "search", space().initial), both)
    memory.remember(trial(context, 3, "search", {**space().initial, SERIES: 0.4}, fails=True), both)
    recollection = memory.recall(9000)
    assert recollection is not None
    found = rows(recollection.content)
    assert [row["asked_by"] for row in found] == ["initial", "warm-up", "fit", "agent"]
    assert found[2]["note"] == "h"
    assert found[3]["note"].startswith("simulation_failed: gave up")


def test_the_start_alone_is_no_history(context: RunContext) -> None:
    memory = HistoryMemory(HistoryOptions(), context)
    memory.remember(trial(context, 0, "initial", space().initial), None)
    assert memory.recall(9000) is None


def test_history_counts_steps_from_the_closest_trial(context: RunContext) -> None:
    memory = HistoryMemory(HistoryOptions(), context)
    memory.remember(trial(context, 0, "initial", {**space().initial, CAPACITY: 1.0}), None)
    memory.remember(trial(context, 1, "search", {**space().initial, CAPACITY: 1.21}), None)
    recollection = memory.recall(9000)
    assert recollection is not None
    place = list(space().names).index(CAPACITY)
    assert [row["steps_from_present"][place] for row in rows(recollection.content)] == [-2.0, 0.0]
    told = recollection.content["features_in_the_order_of_the_feedback"]
    assert list(told) == ["trial_0"]


def test_priors_tell_bounds_and_only_rules_that_apply(context: RunContext) -> None:
    recollection = Priors(NoOptions(), context).recall(9000)
    assert recollection is not None
    assert recollection.content["bounds"][CAPACITY] == [0.5, 3.0]
    assert recollection.content["rules"]["rows"] == []


def test_rules_with_the_same_effect_share_a_row(context: RunContext) -> None:
    rules = [
        {"parameter": name, "raises": ["discharge_time"], "lowers": [], "why": f"why {name}"} for name in space().names
    ]
    rules[-1]["lowers"] = ["polarisation"]
    domain = replace(context.task.domain, rules=tuple(rules))
    told = Priors(NoOptions(), replace(context, task=replace(context.task, domain=domain))).recall(9000)
    assert told is not None
    *alike, other = space().names
    assert told.content["rules"]["rows"] == [
        ["discharge_time", "", [[name, f"why {name}"] for name in alike]],
        ["discharge_time", "polarisation", [[other, f"why {other}"]]],
    ]


def test_feedback_without_features_still_teaches(context: RunContext) -> None:
    memory = SensitivityMemory(NoOptions(), context)
    for index, factor in enumerate((1.0, 1.1, 1.2)):
        good = trial(context, index, "initial" if index == 0 else "warm-up", {**space().initial, CAPACITY: factor})
        feedback = Feedback({"residuals": {"total_mape_pct": 100.0 - 10.0 * index}})
        memory.remember(Trial(**{**good.__dict__, "feedback": feedback}), None)
    recollection = memory.recall(9000)
    assert recollection is not None
    assert learnt(memory, recollection.content).effects[CAPACITY]["total_mape_pct"] < 0


def test_parameters_that_do_the_same_are_named(context: RunContext) -> None:
    from bsa.plugins.memory.sensitivities import _alike

    effects = np.array([[10.0, 5.0, 1.0], [-2.0, -1.0, 0.4], [0.3, 0.15, -0.9]])
    assert _alike(effects, ("a", "b", "c")) == [["a", "b"]]
    assert _alike(effects[:, [0, 1, 0, 2]], ("a", "b", "c", "d")) == [["a", "b", "c"]]
    assert _alike(np.zeros((3, 2)), ("a", "b")) == []


def test_what_the_warm_up_did_not_measure_is_absent(context: RunContext) -> None:
    memory = SensitivityMemory(NoOptions(), context)
    memory.remember(trial(context, 0, "initial", space().initial), None)
    for index, factor in enumerate((1.1, 1.2, 1.3), start=1):
        moved = trial(context, index, "warm-up", {**space().initial, CAPACITY: factor})
        shown = {name: value for name, value in moved.feedback.numbers.items() if "time" not in name}
        memory.remember(Trial(**{**moved.__dict__, "feedback": Feedback({"features": shown})}), None)
    recollection = memory.recall(9000)
    assert recollection is not None
    effects = learnt(memory, recollection.content).effects
    assert set(effects) == {CAPACITY}
    assert "cc_discharge_early_shift_mv" in effects[CAPACITY]
    assert "cc_discharge_time_mismatch_s" not in effects[CAPACITY]


def test_every_search_trial_corrects_the_effects_along_its_own_direction(context: RunContext) -> None:
    memory = SensitivityMemory(NoOptions(), context)
    start, there = space().initial, {**space().initial, CAPACITY: 1.6, SERIES: 0.03}
    memory.remember(trial(context, 0, "initial", start), None)
    for index, name in enumerate(space().names, start=1):
        memory.remember(trial(context, index, "warm-up", {**start, name: start[name] * 1.1}), None)
    before = learnt(memory, memory.recall(9000).content).effects[CAPACITY]["cc_discharge_time_mismatch_s"]
    memory.remember(Trial(**{**trial(context, 9, "search", there).__dict__, "round": 1}), None)
    memory.remember(Trial(**{**trial(context, 10, "search", {**there, CAPACITY: 1.5}).__dict__, "round": 2}), None)
    content = memory.recall(9000).content
    after = learnt(memory, content)
    # A tenth of a larger capacity is more: the slope per step grows with the capacity.
    assert after.effects[CAPACITY]["cc_discharge_time_mismatch_s"] > 1.2 * before
    columns, table_rows = read_table(content["effects"])
    told = {row[0]: dict(zip(columns, row, strict=True)) for row in table_rows}
    assert told[CAPACITY]["points"] == 3
    assert told[CAPACITY]["misprediction_pct"] > told["Relaxation time [s]"]["misprediction_pct"] >= 0.0
    predicted = content["predicted_of_trial_10_in_the_order_of_the_feedback"]
    assert len(predicted) == len(told[CAPACITY]["effects"])


def test_perturbations_on_top_of_a_shared_move_tell_the_effects_there(context: RunContext) -> None:
    def gained(name: str) -> float:
        return record({**there, name: 1.1 * there[name]}).duration - record(there).duration

    start = space().initial
    there = {**start, CAPACITY: 2.0 * start[CAPACITY]}
    memory = SensitivityMemory(NoOptions(), context)
    memory.remember(trial(context, 0, "initial", start), None)
    memory.remember(trial(context, 1, "warm-up", there), None)
    memory.remember(trial(context, 2, "warm-up", {**there, SERIES: 1.1 * there[SERIES]}), None)
    memory.remember(trial(context, 3, "warm-up", {**there, CAPACITY: 1.1 * there[CAPACITY]}), None)
    effects = learnt(memory, memory.recall(9000).content).effects
    for name in (SERIES, CAPACITY):
        assert effects[name]["cc_discharge_time_mismatch_s"] == pytest.approx(gained(name), rel=0.1)


def test_a_reduced_simulation_teaches_nothing_of_the_task(context: RunContext) -> None:
    memory = SensitivityMemory(NoOptions(), context)
    memory.remember(trial(context, 0, "initial", space().initial), None)
    moved = trial(context, 1, "search", {**space().initial, CAPACITY: 1.3})
    memory.remember(Trial(**{**moved.__dict__, "reduction": TaskReduction(0.5)}), None)
    assert memory.recall(9000) is None


def test_history_tells_the_features_of_the_agents_own_attempt(context: RunContext) -> None:
    memory = HistoryMemory(HistoryOptions(), context)
    memory.remember(trial(context, 0, "initial", space().initial), None)
    both = Proposal((), details={"authors": ["agent", "fit"]})
    memory.remember(trial(context, 1, "search", {**space().initial, SERIES: 0.4}), both)
    memory.remember(trial(context, 2, "search", {**space().initial, SERIES: 0.5}), both)
    recollection = memory.recall(9000)
    assert recollection is not None
    assert list(recollection.content["features_in_the_order_of_the_feedback"]) == ["trial_1"]
