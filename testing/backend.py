"""What a backend promises: one method behind which a language model stands."""

import json
from collections.abc import Iterator
from typing import Any

import pytest

from ..backends.checked import CheckedBackend
from ..core.contracts.registry import Listing, installed
from ..core.errors import BsaError
from ..core.messages import Backend, BackendFailure, JsonSchema, Message
from .entry import EntryConformance

SCHEMA: JsonSchema = {
    "type": "object",
    "properties": {
        "analysis": {"type": "string"},
        "hypothesis": {"type": "string"},
        "updated_params": {"type": "object", "properties": {"Negative particle radius [m]": {"type": "string"}}},
        "rationale": {"type": "string"},
    },
    "required": ["analysis", "hypothesis", "updated_params", "rationale"],
    "additionalProperties": False,
}
"""The form of a small proposal."""

MESSAGES = (
    Message("system", "You calibrate a battery model. Answer with one JSON object."),
    Message("user", "The simulated discharge is too short. Which parameter do you change, and how?"),
)


class BackendConformance(EntryConformance):
    """Tests of a backend that can be asked here; a subclass gives the fixture ``name``."""

    kind = "backend"

    @pytest.fixture
    def backend(self, name: str, options: dict[str, Any], listing: Listing) -> Iterator[Backend]:
        """The backend, with every answer checked."""
        made = CheckedBackend(installed().make("backend", name, options), listing.who)
        yield made
        made.close()

    def test_it_says_what_it_is(self, backend: Backend) -> None:
        """Results and reports name it."""
        assert backend.name.strip()

    def test_a_question_has_a_reply(self, backend: Backend) -> None:
        """A text, and what it cost; an object of the schema where the backend says that it holds to it."""
        reply = backend.complete(MESSAGES, SCHEMA, seed=1)
        if reply.structured_by != "text":
            answer = json.loads(reply.text)
            assert isinstance(answer, dict)
            assert reply.structured_by != "schema" or set(SCHEMA["required"]) <= set(answer)

    def test_a_strange_question_has_a_reply_or_is_lost(self, backend: Backend) -> None:
        """What cannot be answered is a `BackendFailure` or a `BsaError`."""
        try:
            backend.complete([Message("user", "")], {"type": "object"}, seed=2**32 - 1)
        except BackendFailure as failure:
            assert str(failure)
        except BsaError as error:
            assert "tell its authors" not in error.hint, error
