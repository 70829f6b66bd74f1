import json

import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.backends.rules.coordinates import change_by, to_steps
from bsa.backends.rules.reading import read_prompt
from bsa.core.messages import Message
from bsa.core.prompt_sections import FEEDBACK, PRIORS, SENSITIVITIES, TASK, TRIALS, section
from bsa.core.proposal import apply_change
from bsa.core.sensitivities import Sensitivities
from hypothesis import given
from hypothesis import strategies as st

PARAMETERS = {
    "Capacity [A.h]": {"initial": 1.0, "now": 1.0, "typical_step": "*1.1"},
    "Initial state of charge": {"initial": 0.5, "now": 0.5, "typical_step": "+0.05"},
}
SCHEMA = {"properties": {"analysis": {}, "hypothesis": {}, "updated_params": {}, "rationale": {}}}


def ask(*sections: str) -> dict[str, object]:
    task = section(TASK, {"parameters": PARAMETERS})
    messages = [Message("system", "s"), Message("user", "\n\n".join([task, *sections]))]
    answer = json.loads(RulesBackend().complete(messages, SCHEMA, seed=0).text)
    assert set(answer) == set(SCHEMA["properties"])
    return dict(answer)


def feedback(**features: float) -> str:
    return section(FEEDBACK, {"trial": 0, "features": features})


def effects(**content: dict[str, float]) -> str:
    return section(SENSITIVITIES, Sensitivities(content).content(9000))


def test_it_solves_what_the_learnt_sensitivities_say() -> None:
    learnt = effects(**{"Capacity [A.h]": {"cc_discharge_time_mismatch_s": 300.0}})
    answer = ask(feedback(cc_discharge_time_mismatch_s=-600.0), learnt)
    change = answer["updated_params"]["Capacity [A.h]"]
    assert apply_change(1.0, change) == pytest.approx(1.1**2, rel=0.01)
    assert "too low" in str(answer["hypothesis"])


def test_linear_parameters_are_moved_by_adding() -> None:
    learnt = effects(**{"Initial state of charge": {"rest_late_shift_mv": 20.0}})
    answer = ask(feedback(rest_late_shift_mv=40.0), learnt)
    assert answer["updated_params"]["Initial state of charge"].startswith("-0.09")


def test_without_memory_it_goes_by_the_domain_rules() -> None:
    priors = section(
        PRIORS,
        {
            "bounds": {"Capacity [A.h]": [0.5, 3.0]},
            "rules": [{"parameter": "Capacity [A.h]", "raises": ["discharge_time"], "lowers": []}],
        },
    )
    answer = ask(feedback(cc_discharge_time_mismatch_s=-600.0), priors)
    assert apply_change(1.0, answer["updated_params"]["Capacity [A.h]"]) > 1.0
    assert "domain rules" in str(answer["rationale"])


def test_bounds_told_in_the_prompt_are_kept() -> None:
    priors = section(PRIORS, {"bounds": {"Capacity [A.h]": [0.5, 1.05]}, "rules": []})
    learnt = effects(**{"Capacity [A.h]": {"cc_discharge_time_mismatch_s": 100.0}})
    answer = ask(feedback(cc_discharge_time_mismatch_s=-600.0), priors, learnt)
    assert apply_change(1.0, answer["updated_params"]["Capacity [A.h]"]) == pytest.approx(1.05, rel=1e-4)


def test_knowing_nothing_it_probes_one_parameter_at_a_time() -> None:
    first = ask(feedback(cc_discharge_time_mismatch_s=-600.0))
    assert len(first["updated_params"]) == 1
    history = section(TRIALS, {"parameters": [], "features": [], "trials": [{}, {}]})
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
    assert list(read_prompt(messages).parameters) == list(PARAMETERS)
