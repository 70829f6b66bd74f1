"""What a stranger's backend takes and gives is checked."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from bsa.backends.opening import check_backend, open_backend
from bsa.core.contracts.registry import Registry
from bsa.core.errors import BsaError
from bsa.core.hooks import Entry, hookimpl
from bsa.core.messages import BackendFailure, Outage, Reply, Usage
from pydantic import BaseModel, Field


class Options(BaseModel, extra="forbid"):
    depth: int = Field(1, ge=1, description="How deep.")
    model: str = Field("small", description="Which.")


class Oracle:
    """Answers with what it is given, or raises it."""

    name: Any = "oracle"
    sees_images = False

    def __init__(self, answer: Any, options: Options | None = None) -> None:
        self.answer, self.options = answer, options

    def complete(self, messages: Any, schema: Any, *, seed: int) -> Any:
        if isinstance(self.answer, BaseException):
            raise self.answer
        return self.answer

    def close(self) -> None:
        if isinstance(self.answer, BaseException):
            raise self.answer


def registry(factory: Any) -> Registry:
    result = Registry()
    hook = hookimpl(lambda: [Entry("zz-oracle", factory, "Of a stranger.", Options, api=1)])
    result.register(SimpleNamespace(bsa_backends=hook), "zz", "zz-fault 0.1")
    return result.collect()


def asked(answer: Any) -> Reply:
    return open_backend("zz-oracle", registry=registry(lambda options: Oracle(answer))).complete([], {}, seed=1)


def test_a_backend_of_a_stranger_answers() -> None:
    reply = Reply("{}", Usage(3, 4, 0, 0.1, 2.0), "oracle", "json", ("slept",))
    assert asked(reply) == reply


def test_a_price_may_be_unknown() -> None:
    assert asked(Reply("", Usage(cost_usd=None))).usage.price == "price unknown"
    assert [Usage(*counts).words for counts in ((), (3, 4), (3, 4, 0, 0.25), (3, 4, 0, None))] == [
        "no tokens",
        "7 tokens",
        "7 tokens, $0.2500",
        "7 tokens, price unknown",
    ]
    assert (Usage(cost_usd=0.5) + Usage(cost_usd=None)).cost_usd is None


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (None, "complete returned None, not a Reply"),
        ("{}", "complete returned '{}' (str), not a Reply"),
        (Reply(None), "Reply.text = None, not a str"),  # type: ignore[arg-type]
        (Reply("", model=7), "Reply.model = 7 (int), not a str"),  # type: ignore[arg-type]
        (Reply("", usage={"tokens": 1}), "Reply.usage = "),  # type: ignore[arg-type]
        (Reply("", None), "Reply.usage = None, not a Usage"),  # type: ignore[arg-type]
        (Reply("", Usage(-1)), "Usage.prompt_tokens = -1, which is negative"),
        (Reply("", Usage(cost_usd=float("nan"))), "Usage.cost_usd = nan, which is not a finite number"),
        (Reply("", structured_by="magic"), "Reply.structured_by = 'magic'"),  # type: ignore[arg-type]
        (Reply("", notes="slept"), "Reply.notes = 'slept', not a tuple of texts"),  # type: ignore[arg-type]
        (RuntimeError("boom"), "boom in complete"),
        (SystemExit(3), "zz-fault 0.1: SystemExit: 3 in complete"),
    ],
)
def test_a_backend_that_breaks_its_word_is_named(answer: Any, words: str) -> None:
    with pytest.raises(BsaError) as raised:
        asked(answer)
    assert raised.value.message.startswith("backend zz-oracle of zz-fault 0.1: ")
    assert words in raised.value.message


@pytest.mark.parametrize("error", [BackendFailure("busy"), Outage("gone"), KeyboardInterrupt(), BsaError("no key.")])
def test_what_is_meant_passes(error: BaseException) -> None:
    with pytest.raises(type(error)) as raised:
        asked(error)
    assert raised.value is error


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (None, "its factory returned NoneType, which lacks name, sees_images, complete, close"),
        (SimpleNamespace(name="x", complete=print), "which lacks sees_images, close"),
        (replace, "which lacks name, sees_images"),
    ],
)
def test_what_is_no_backend_is_refused(made: Any, words: str) -> None:
    with pytest.raises(BsaError, match=words):
        open_backend("zz-oracle", registry=registry(lambda options: made))


def test_its_own_options_are_its_own_and_votes_go_around_it() -> None:
    made: list[Options] = []

    def factory(options: Options) -> Oracle:
        made.append(options)
        return Oracle(Reply("{}"))

    found = registry(factory)
    backend = open_backend("zz-oracle:large", {"depth": 3, "votes": 2}, found)
    assert made == [Options(depth=3, model="large")]
    assert backend.name == "oracle, 2 votes"
    with pytest.raises(
        BsaError, match=r'backend "zz-oracle": "dept" is not a known key\. Hint: did you mean "depth"\?'
    ):
        check_backend("zz-oracle", {"dept": 3}, found)
    with pytest.raises(BsaError, match='"temperature" is not a known key'):
        check_backend("zz-oracle", {"temperature": 1.0}, found)
    with pytest.raises(BsaError, match='"votes" is 0'):
        check_backend("zz-oracle", {"votes": 0}, found)
    assert len(made) == 1
