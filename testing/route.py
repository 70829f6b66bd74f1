"""What a route to language models promises."""

import time
from typing import Any

import pytest

from ..backends.checked import CheckedRoute
from ..backends.options import BackendOptions
from ..core.contracts.registry import Listing
from ..core.errors import BsaError
from ..core.messages import BackendFailure
from .backend import MESSAGES, SCHEMA
from .entry import EntryConformance

_LONGEST_LOOK_S = 5.0
"""A check takes a second; a busy machine takes longer."""


class RouteConformance(EntryConformance):
    """Tests of a route that need no model; a subclass gives the fixture ``name``."""

    kind = "route"

    @pytest.fixture
    def options(self) -> dict[str, Any]:
        """Lost calls are not made again."""
        return {"retry_limit_s": 0.0, "timeout_s": 5.0}

    @pytest.fixture
    def missing(self) -> str:
        """A model that this route cannot have."""
        return "no-such-model-anywhere"

    @pytest.fixture
    def route(self, name: str, options: dict[str, Any]) -> CheckedRoute:
        """The route, with every answer checked."""
        return CheckedRoute(name, options)

    def test_its_options_are_those_of_a_backend(self, listing: Listing) -> None:
        """``--backend-option`` sets them, whichever route is named."""
        assert issubclass(listing.entry.config_type, BackendOptions)

    def test_a_look_is_short_and_says_what_to_do(self, route: CheckedRoute, missing: str) -> None:
        """None for a model that can be asked; else the reason and the one command that would change it."""
        route.check(missing)  # imports libraries
        started = time.monotonic()
        found = route.check(missing)
        assert time.monotonic() - started < _LONGEST_LOOK_S
        assert found is None or (found.detail and found.remedy)

    def test_a_missing_model_is_told(self, route: CheckedRoute, missing: str) -> None:
        """On opening by a `BsaError` with a hint, or when it is asked by a lost call."""
        try:
            backend = route.open(missing, "under test")
        except BsaError as error:
            assert error.hint
            assert "tell its authors" not in error.hint, error
            return
        assert backend.name == "under test"
        try:
            with pytest.raises((BackendFailure, BsaError)) as lost:
                backend.complete(MESSAGES, SCHEMA, seed=1)
            assert "tell its authors" not in str(lost.value)
        finally:
            backend.close()
