from types import SimpleNamespace

import pytest
from bsa.core.errors import BsaError
from bsa.core.hooks import Entry, NoOptions, hookimpl
from bsa.core.registry import Registry, installed
from pydantic import Field


class Options(NoOptions):
    depth: int = Field(1, description="How deep.")


def plugin(*entries: Entry) -> object:
    def bsa_memories() -> list[Entry]:
        return list(entries)

    return SimpleNamespace(bsa_memories=hookimpl(bsa_memories))


def entry(name: str = "elephant", **changes: object) -> Entry:
    return Entry(**{"name": name, "factory": object, "summary": "Forgets nothing.", **changes})  # type: ignore[arg-type]


def registry(*plugins: object) -> Registry:
    result = Registry()
    for number, item in enumerate(plugins):
        result.register(item, f"plugin-{number}", f"dist-{number} 1.{number}")
    return result.collect()


def test_built_in_and_third_party_plugins_are_found_the_same_way() -> None:
    origins = {listing.origin.split()[0] for listing in installed().listings()}
    assert {"battery-sim-agent", "bsa-toy-cell"} <= origins
    assert "toy-cell" in installed().names("simulator")


def test_an_unknown_name_is_met_with_the_nearest() -> None:
    with pytest.raises(BsaError, match=r'there is no memory "elefant"\. Hint: did you mean "elephant"\?'):
        registry(plugin(entry())).get("memory", "elefant")


def test_two_plugins_of_one_name_are_refused_naming_both() -> None:
    with pytest.raises(BsaError, match=r"dist-0 1\.0 and dist-1 1\.1"):
        registry(plugin(entry()), plugin(entry()))


def test_two_distributions_that_claim_one_entry_point_are_refused_naming_both() -> None:
    result = Registry()
    result.register(plugin(), "memory", "first 1.0")
    with pytest.raises(BsaError, match=r'"memory": first 1\.0 and second 2\.0'):
        result.register(plugin(), "memory", "second 2.0")


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (entry(api=99), "plugin interface 99"),
        (entry(name="Bad Name"), 'names a memory "Bad Name"'),
        ("not an entry", "yield bsa.core.hooks.Entry"),
    ],
)
def test_entries_that_cannot_work_are_refused(bad: object, words: str) -> None:
    with pytest.raises(BsaError, match=words):
        registry(plugin(bad))  # type: ignore[arg-type]


def test_an_unknown_hook_is_refused() -> None:
    def bsa_memorys() -> list[Entry]:
        return []

    with pytest.raises(BsaError, match="unknown hook"):
        registry(SimpleNamespace(bsa_memorys=hookimpl(bsa_memorys)))


def test_options_are_checked_against_the_configuration_type() -> None:
    found = registry(plugin(entry(config_type=Options)))
    assert found.configure("memory", "elephant", {"depth": 3}).depth == 3
    with pytest.raises(BsaError, match=r'"dept" is not a known key\. Hint: did you mean "depth"\?'):
        found.configure("memory", "elephant", {"dept": 3})
    with pytest.raises(BsaError, match='memory "elephant": "depth" is'):
        found.configure("memory", "elephant", {"depth": "deep"})
