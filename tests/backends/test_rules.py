import json

import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.backends.rules.reading import read_prompt
from bsa.core.feedback import Feedback
from bsa.core.inference.typical_steps import change_by, to_steps
from bsa.core.messages import Message
from bsa.core.prompt_sections import FEEDBACK, LAST_ATTEMPT, PRIORS, SENSITIVITIES, TASK, TRIALS, section, table
from bsa.core.proposal import apply_change
from bsa.core.sensitivities import Sensitivities
from hypothesis import given
from hypothesis import strategies as st

CAPACITY, CHARGE = "Capacity [A.h]", "Initial state of charge"
COLUMNS = ("parameter", "now", "step", "lower", "upper")
PARAMETERS = table(COLUMNS, [[CAPACITY, 1.0, "*1.1", 0.5, 3.0], [CHARGE, 0.5, "+0.05", 0.0, 1.0]])
SCHEMA = {"properties": {"analysis": {}, "hypothesis": {}, "updated_params": {}, "rationale": {}}}


def ask(*sections: str, parameters: object = PARAMETERS) -> dict[str, object]:
    task = section(TASK, {"parameters": parameters})
    messages = [Message("system", "s"), Message("user", "\n\n".join([task, *sections]))]
    answer = json.loads(RulesBackend().complete(messages, SCHEMA, seed=0).text)
    assert set(answer) == set(SCHEMA["properties"])
    return dict(answer)


def feedback(**features: float) -> str:
    return section(FEEDBACK, {"trial": 0, **Feedback({"features": features}).told()})


def effects(**content: dict[str, float]) -> str:
    return section(SENSITIVITIES, Sensitivities(content).content(9000))


def test_it_solves_what_the_learnt_sensitivities_say() -> None:
    learnt = effects(**{"Capacity [A.h]": {"cc_discharge_time_mismatch_s": 300.0}})
    answer = ask(feedback(cc_discharge_time_mismatch_s=-600.0), learnt)
    change = answer["updated_params"]["Capacity [A.h]"]
    assert apply_change(1.0, change) == pytest.approx(1.1**2, rel=0.01)
    assert answer["hypothesis"] == 'Capacity [A.h] is too low: its change moves "CC discharge time mismatch" most.'
    assert "CC discharge time mismatch is -600 s." in str(answer["analysis"])


def test_linear_parameters_are_moved_by_adding() -> None:
    learnt = effects(**{"Initial state of charge": {"rest_late_shift_mv": 20.0}})
    answer = ask(feedback(rest_late_shift_mv=40.0), learnt)
    assert '"rest late shift" most' in str(answer["hypothesis"])
    # 40 mV at 20 mV a typical step, and a damping of a few thousandths.
    assert float(answer["updated_params"]["Initial state of charge"]) == pytest.approx(-0.1, rel=1e-2)


def test_without_memory_it_goes_by_the_domain_rules() -> None:
    rules = table(["raises", "lowers", "parameters_and_why"], [["discharge_time", "", [[CAPACITY, ""]]]])
    priors = section(PRIORS, {"rules": rules})
    answer = ask(feedback(cc_discharge_time_mismatch_s=-600.0), priors)
    assert apply_change(1.0, answer["updated_params"]["Capacity [A.h]"]) > 1.0
    assert "domain rules" in str(answer["rationale"])


def test_bounds_told_in_the_prompt_are_kept() -> None:
    bounded = table(COLUMNS, [[CAPACITY, 1.0, "*1.1", 0.5, 1.05]])
    learnt = effects(**{"Capacity [A.h]": {"cc_discharge_time_mismatch_s": 100.0}})
    answer = ask(feedback(cc_discharge_time_mismatch_s=-600.0), learnt, parameters=bounded)
    assert apply_change(1.0, answer["updated_params"]["Capacity [A.h]"]) == pytest.approx(1.05, rel=1e-4)


def test_knowing_nothing_it_probes_one_parameter_at_a_time() -> None:
    first = ask(feedback(cc_discharge_time_mismatch_s=-600.0))
    assert len(first["updated_params"]) == 1
    rows = [[number, "search", [0.0, 0.0]] for number in range(2)]
    history = section(TRIALS, {"trials": table(["trial", "asked_by", "steps_from_present"], rows)})
    later = ask(feedback(cc_discharge_time_mismatch_s=-600.0), history)
    assert set(later["updated_params"]) != set(first["updated_params"])


def test_it_answers_a_prompt_it_cannot_read() -> None:
    reply = RulesBackend().complete([Message("user", "## Task\n```json\n{broken\n```")], SCHEMA, seed=0)
    assert json.loads(reply.text)["updated_params"] == {}


def test_warm_up_designs_change_each_parameter_alone_first() -> None:
    schema = {"properties": {"perturbations": {"maxItems": 4}}}
    messages = [Message("user", section(TASK, {"parameters": PARAMETERS}))]
    rows = json.loads(RulesBackend().complete(messages, schema, seed=0).text)["perturbations"]
    assert [list(row) for row in rows[:2]] == [["Capacity [A.h]"], ["Initial state of charge"]]
    assert rows[0]["Capacity [A.h]"] == "*1.1"
    assert rows[1]["Initial state of charge"] == "+0.05"


@given(st.floats(-8, 8), st.sampled_from(["*1.1", "+0.03", "*1.02"]), st.floats(0.01, 100))
def test_steps_there_and_back(steps: float, step: str, value: float) -> None:
    moved = apply_change(value, change_by(steps, step, digits=15))
    if step.startswith("*") or moved > 0:
        assert to_steps(moved, step) - to_steps(value, step) == pytest.approx(steps, abs=1e-6)


def test_it_sees_only_the_first_user_message() -> None:
    messages = [
        Message("user", section(TASK, {"parameters": PARAMETERS})),
        Message("assistant", "{}"),
        Message("user", section(TASK, {"parameters": {}})),
    ]
    assert list(read_prompt(messages).parameters) == [CAPACITY, CHARGE]


ALONE = {"properties": {"action": {"enum": ["set", "jacobian"]}, **SCHEMA["properties"]}}


def act(*sections: str) -> dict[str, object]:
    messages = [Message("user", "\n\n".join([section(TASK, {"parameters": PARAMETERS}), *sections]))]
    return dict(json.loads(RulesBackend().complete(messages, ALONE, seed=0).text))


def test_what_is_not_measured_is_measured_where_there_is_room_for_it() -> None:
    told = {"trial": 0, **Feedback({"features": {"rest_late_shift_mv": 40.0}}).told()}
    learnt = effects(**{CAPACITY: {"rest_late_shift_mv": 3.0}})
    answer = act(section(FEEDBACK, {**told, "simulations_left": 9}), learnt)
    assert (answer["action"], answer["params"]) == ("jacobian", [CHARGE])
    assert act(section(FEEDBACK, {**told, "simulations_left": 1}), learnt)["action"] == "set"
    assert act(section(FEEDBACK, {**told, "simulations_left": 9}))["action"] == "set"


def test_after_a_change_that_was_no_better_the_next_is_shorter() -> None:
    learnt = effects(**{CAPACITY: {"cc_discharge_time_mismatch_s": 100.0}})
    failed = section(LAST_ATTEMPT, {"trial": 3, "changed_by_steps": {CAPACITY: 2.0}})
    answer = ask(feedback(cc_discharge_time_mismatch_s=-600.0), learnt, failed)
    assert apply_change(1.0, answer["updated_params"][CAPACITY]) == pytest.approx(1.1**0.8, rel=1e-3)
