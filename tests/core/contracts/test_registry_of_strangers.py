"""Distributions of strangers that are broken in every way: none stops anybody who does not use them."""

from collections.abc import Callable
from pathlib import Path

import pytest
from bsa.core.contracts.registry import Registry
from bsa.core.errors import BsaError

Install = Callable[..., Path]

LISTING = """
from bsa.core.hooks import Entry, hookimpl

@hookimpl
def bsa_memories():
    {body}
"""

BROKEN = {
    "no-library": (
        "import a_library_that_nobody_has",
        "ModuleNotFoundError: No module named 'a_library_that_nobody_has'",
    ),
    "bad-import": (
        "from bsa.core.hooks import NothingOfThisName",
        "ImportError: cannot import name 'NothingOfThisName'",
    ),
    "bad-syntax": ("def f(:", "SyntaxError"),
    "leaves": ("raise SystemExit(0)", "SystemExit: 0"),
    "panics": ("class Panic(BaseException): pass\nraise Panic('at the disco')", "Panic: at the disco"),
    "raises": (LISTING.format(body="raise ValueError('boom')"), "ValueError: boom in bsa_memories"),
    "exits": (LISTING.format(body="raise SystemExit('bye')"), "SystemExit: bye in bsa_memories"),
    "no-list": (LISTING.format(body="return None"), "TypeError: 'NoneType' object is not iterable in bsa_memories"),
    "none": (LISTING.format(body="yield None"), "it lists None"),
    "no-entry": (LISTING.format(body="yield 'zz-mem'"), "it lists 'zz-mem'"),
    "old": (
        LISTING.format(body="yield Entry('zz-mem', object, 's')"),
        "missing 1 required keyword-only argument: 'api'",
    ),
    "older": (LISTING.format(body="yield Entry('zz-mem', object, 's', api=0)"), "written for plugin interface 0"),
    "taken": (LISTING.format(body="yield Entry('history', object, 's', api=1)"), "taken by battery-sim-agent"),
    "typo": (
        "from bsa.core.hooks import hookimpl\n@hookimpl\ndef bsa_simulatorz():\n    return []",
        '"bsa_simulatorz" is no hook: did you mean "bsa_simulators"?',
    ),
    "unmarked": ("def bsa_effects():\n    return []", '"bsa_effects" is named as a hook and not marked'),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_plugin_is_listed_with_its_reason_and_stops_nobody(stranger: Install, name: str) -> None:
    code, reason = BROKEN[name]
    whole = Registry().load_entry_points()
    stranger(code, name)
    stranger(LISTING.format(body="yield Entry('zz-good', dict, 's', api=1)"), "zz-good")
    found = Registry().load_entry_points()
    assert {item.entry.name for item in found.listings()} == {item.entry.name for item in whole.listings()} | {
        "zz-good"
    }
    (fault,) = [item for item in found.unusable if item not in whole.unusable]
    assert fault.origin == f"{name} 0.1"
    assert reason in fault.reason
    assert fault.reason.isprintable()


@pytest.mark.parametrize("name", ["no-library", "leaves", "raises", "none", "old"])
def test_who_asks_for_what_a_broken_plugin_may_offer_is_told_of_it(stranger: Install, name: str) -> None:
    code, reason = BROKEN[name]
    stranger(code, name)
    with pytest.raises(BsaError, match='there is no memory "zz-mem"') as raised:
        Registry().load_entry_points().find("memory", "zz-mem")
    assert f"{name} 0.1 cannot be used" in raised.value.hint
    assert reason in raised.value.hint


def test_two_strangers_of_one_name_are_both_named(stranger: Install) -> None:
    for name in ("zz-first", "zz-second"):
        stranger(LISTING.format(body="yield Entry('zz-mem', dict, 's', api=1)"), name)
    found = Registry().load_entry_points()
    assert "zz-mem" not in found.names("memory")
    with pytest.raises(BsaError) as raised:
        found.find("memory", "zz-mem")
    assert "zz-first 0.1: the name is also offered by zz-second 0.1" in str(raised.value)
    assert raised.value.hint in (
        "update or uninstall zz-first or zz-second.",
        "update or uninstall zz-second or zz-first.",
    )


def test_metadata_that_cannot_be_read_is_passed_over(stranger: Install) -> None:
    folder = stranger(LISTING.format(body="yield Entry('zz-mem', dict, 's', api=1)"))
    damaged = folder / "zz_damaged-1.dist-info"
    damaged.mkdir()
    (damaged / "entry_points.txt").write_bytes(b"[bsa]\n\xff\xfe = x\n")
    assert "zz-mem" in Registry().load_entry_points().names("memory")


def test_a_distribution_that_another_of_its_name_hides_is_passed_over(
    stranger: Install, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stranger(LISTING.format(body="yield Entry('zz-mem', dict, 's', api=1)"), "zz-plugin")
    assert "zz-mem" in Registry().load_entry_points().names("memory")
    newer = tmp_path / "earlier-on-the-path"
    about = newer / "zz_plugin-0.2.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: zz-plugin\nVersion: 0.2\n")
    monkeypatch.syspath_prepend(str(newer))
    assert "zz-mem" not in Registry().load_entry_points().names("memory")
