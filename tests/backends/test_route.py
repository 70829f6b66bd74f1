"""Routes of strangers stand beside ours: by name, under a preset, and in what a user is shown."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from bsa.backends.checked import CheckedRoute
from bsa.backends.opening import check_backend, on_own_machines, open_backend
from bsa.backends.options import BackendOptions
from bsa.backends.readiness import check, survey
from bsa.core.contracts.registry import installed
from bsa.core.errors import BsaError
from bsa.experiments.cli.catalogue import doctor, plugins

Install = Callable[..., Path]

ROUTE = """
from bsa.backends.options import BackendOptions
from bsa.backends.route import NotReady, Route
from bsa.core.hooks import Entry, hookimpl
from bsa.core.messages import Reply
from pydantic import Field

class Options(BackendOptions):
    region: str = Field("here", description="Where.")

class Model:
    sees_images = False
    def __init__(self, name, options): self.name, self.options = name, options
    def complete(self, messages, schema, *, seed): return Reply("{{}}", model=str(self.options.base_url))
    def close(self): pass

class ZzRoute(Route):
    takes_base_url = True
    on_own_machines = True
    def check(self, model):
        {check}
    def open(self, model, name):
        {open}

@hookimpl
def bsa_routes():
    yield Entry("{name}", {factory}, "{name}:MODEL, of a stranger.", Options, api=1)
"""


@pytest.fixture
def route(stranger: Install, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Installs a route of a stranger and a preset that names it before one of ours."""
    (tmp_path / "mine.yaml").write_text("mine:\n  zz-route: [gone, there]\n  litellm: openai/o3\n")
    monkeypatch.setenv("BSA_PRESETS", str(tmp_path / "mine.yaml"))

    def install(**changes: str) -> None:
        parts = {
            "name": "zz-route",
            "factory": "ZzRoute",
            "check": "return None if model == 'there' else NotReady('gone away', 'call it back')",
            "open": "return Model(name, self.options)",
        }
        stranger(ROUTE.format(**{**parts, **changes}), "zz-dist")

    return install


def test_it_opens_by_name_and_under_a_preset(route: Callable[..., None]) -> None:
    route()
    assert open_backend("zz-route:any").name == "zz-route:any"
    assert open_backend("mine").name == "mine via zz-route"
    assert open_backend("mine", {"via": "zz-route", "votes": 2}).name == "mine via zz-route, 2 votes"
    check_backend("zz-route:any", {"region": "there"})
    with pytest.raises(BsaError, match=r'backend "zz-route": "regon" is not a known key\. Hint: did you mean "region"'):
        check_backend("zz-route:any", {"regon": "there"})
    with pytest.raises(BsaError, match="write zz-route:MODEL"):
        open_backend("zz-route")
    assert on_own_machines("zz-route:any", {})
    assert on_own_machines("mine", {"via": "zz-route"})
    assert not on_own_machines("mine", {"via": "litellm"})
    assert not on_own_machines("rules", {})


@pytest.mark.slow
def test_the_user_sees_it(route: Callable[..., None], capsys: pytest.CaptureFixture[str]) -> None:
    route()
    rows = {(item.backend, item.route): item for item in survey()}
    assert rows["mine", "zz-route"].ready
    assert rows["mine", "zz-route"].model == "there"
    doctor()
    plugins()
    shown = [line.split() for line in capsys.readouterr().out.splitlines()]
    summary = ["zz-route:MODEL,", "of", "a", "stranger."]
    assert ["mine", "zz-route:", "ready", "ready"] in shown
    assert ["zz-route", "zz-dist", "0.1", *summary] in shown
    assert shown.count(["zz-route", *summary, "(zz-dist", "0.1)"]) == 1
    assert "zz-route" in installed().names("backend")


def test_a_route_that_is_not_there_is_told_with_the_nearest(route: Callable[..., None]) -> None:
    route()
    for spec in ("mine", "openai:m", "manual"):
        with pytest.raises(BsaError, match=r'there is no route "zz-rout"\. Hint: did you mean "zz-route"'):
            check_backend(spec, {"via": "zz-rout"})
    with pytest.raises(BsaError, match='there is no route "rules"'):
        check_backend("mine", {"via": "rules"})
    with pytest.raises(BsaError, match=r'there is no backend "zz-rout"\. Hint: did you mean "zz-route"'):
        open_backend("zz-rout:m")


def test_an_address_goes_to_the_route_that_it_means(route: Callable[..., None]) -> None:
    route()
    address = "http://127.0.0.1:1/v1"
    backend = open_backend("mine", {"via": "zz-route", "base_url": address})
    assert backend.complete([], {}, seed=1).model == address
    with pytest.raises(BsaError, match=r'"mine" cannot be reached via openai\. Hint: its routes are zz-route, litellm'):
        open_backend("mine", {"base_url": address})
    for name in ("litellm", "transformers"):
        with pytest.raises(BsaError, match=f"--base-url does not go with {name}:m.*write openai:m"):
            open_backend(f"{name}:m", {"base_url": address})


def test_a_built_in_name_stays_built_in(route: Callable[..., None], capsys: pytest.CaptureFixture[str]) -> None:
    route(name="rules")
    doctor()
    assert "route rules zz-dist 0.1 the name is taken by" in " ".join(capsys.readouterr().out.split())
    assert open_backend("rules").name == "rules"
    with pytest.raises(
        BsaError, match=r'the route "rules" cannot be used \(zz-dist 0\.1: the name is taken by battery'
    ):
        CheckedRoute("rules", {})


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("return 'busy'", "check returned 'busy' (str), not a NotReady"),
        ("return NotReady(None, '')", "check gave NotReady.detail = None, not a str"),
        ("raise SystemExit(3)", "SystemExit: 3 in check"),
        ("import no_such_library", "No module named 'no_such_library' in check"),
    ],
)
def test_a_route_that_cannot_be_checked_is_not_ready_and_stops_nobody(
    route: Callable[..., None], body: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    route(check=body)
    monkeypatch.setenv("OPENAI_API_KEY", "some-value")
    assert open_backend("mine").name == "mine via litellm"
    row = check("m", "zz-route", "there", BackendOptions())
    assert not row.ready
    assert row.detail.startswith(f"route zz-route of zz-dist 0.1: {words}")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"factory": "dict"}, "its factory returned "),
        ({"open": "return None"}, "open returned NoneType, which lacks name, sees_images, complete, close"),
        ({"open": "raise RuntimeError('boom')"}, "boom in open"),
    ],
)
def test_a_route_that_cannot_be_opened_is_named(
    route: Callable[..., None], changes: dict[str, str], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    route(**changes)
    monkeypatch.setenv("OPENAI_API_KEY", "some-value")
    assert open_backend("mine", {"via": "litellm"}).name == "mine via litellm"
    with pytest.raises(BsaError) as raised:
        open_backend("zz-route:there")
    assert raised.value.message.startswith(f"route zz-route of zz-dist 0.1: {words}")
