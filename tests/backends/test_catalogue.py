"""Every built-in backend that needs no model, and every route, keeps what its kind promises."""

import pytest
from bsa.core.contracts.registry import installed
from bsa.testing import BackendConformance, RouteConformance

NEED_NO_MODEL = ("rules", "random-advice", "adversarial-advice")
ROUTES = [
    pytest.param(listing.entry.name, marks=[pytest.mark.slow] if listing.entry.name == "transformers" else [])
    for listing in installed().listings("route")
    if listing.own
]


class TestBackend(BackendConformance):
    @pytest.fixture(params=NEED_NO_MODEL)
    def name(self, request: pytest.FixtureRequest) -> str:
        return request.param


class TestRoute(RouteConformance):
    @pytest.fixture(params=ROUTES)
    def name(self, request: pytest.FixtureRequest) -> str:
        return request.param
