import json

import pytest
from bsa.core.discovery.ranking import ask
from bsa.core.messages import BackendFailure, Reply
from bsa.plugins.effects.catalogue import EFFECTS

CHOICE = [e for e in EFFECTS if e.key in ("contact-resistance", "self-heating", "voltage-offset", "time-lag")]


class Says:
    name, sees_images = "says", False

    def __init__(self, answer):
        self.answer, self.messages, self.schema = answer, None, None

    def complete(self, messages, schema, *, seed):
        self.messages, self.schema = messages, schema
        if isinstance(self.answer, Exception):
            raise self.answer
        return Reply(self.answer(messages) if callable(self.answer) else self.answer)

    def close(self):
        pass


def test_a_ranking_is_read_and_unknown_names_are_dropped():
    rows = [{"name": "self-heating", "reason": "grows\x1b[31m"}, {"name": "magic", "reason": ""}, {"name": "time-lag"}]
    answer = {"analysis": "it grows\x07 with time", "ranking": rows}
    ranking = ask(Says(json.dumps(answer)), ["28 mV too high"], CHOICE, seed=1)
    assert ranking.analysis == "it grows with time"
    assert [r.key for r in ranking.ranked] == ["self-heating", "time-lag"]
    assert "\x1b" not in ranking.ranked[0].reason
    assert ranking.note == ""


@pytest.mark.parametrize("answer", [BackendFailure("no reply"), "I think it is heat.", '{"ranking": "heat"}', "{}"])
def test_a_useless_reply_is_a_note_and_never_an_error(answer):
    ranking = ask(Says(answer), ["x"], CHOICE, seed=1)
    assert ranking.ranked == ()
    assert ranking.note
    assert ranking.lost == isinstance(answer, BackendFailure)


def test_hidden_names_show_no_name_and_are_mapped_back():
    def pick(messages):
        listing = json.loads(messages[-1].text)["effects"]
        (row,) = [e for e in listing if "square of the rate" in e["signature"]]
        return json.dumps({"ranking": [{"name": row["name"], "reason": "by signature"}]})

    backend = Says(pick)
    ranking = ask(backend, ["x"], CHOICE, seed=4, hide_names=True)
    assert [r.key for r in ranking.ranked] == ["self-heating"]
    for effect in CHOICE:
        assert f'"{effect.key}"' not in backend.messages[-1].text
        assert effect.title not in backend.messages[-1].text
    assert ranking.shown_as["self-heating"].startswith("effect-")


def test_the_list_tells_nothing_of_the_order_that_statistics_have_effects_in():
    first, second = Says("{}"), Says("{}")
    ask(first, ["x"], CHOICE, seed=2)
    ask(second, ["x"], CHOICE[::-1], seed=2)
    assert first.messages == second.messages


def test_a_model_that_is_held_to_the_schema_thinks_before_it_ranks():
    backend = Says("{}")
    ask(backend, ["x"], CHOICE, seed=2)
    assert list(backend.schema["properties"]) == ["analysis", "ranking"]
