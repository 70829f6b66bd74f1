from collections.abc import Iterator
from types import SimpleNamespace

import pytest
from bsa.core.contracts.registry import Registry, installed
from bsa.core.errors import BsaError
from bsa.core.hooks import Entry, NoOptions, hookimpl
from pydantic import Field


class Options(NoOptions):
    depth: int = Field(1, description="How deep.")


def plugin(*entries: Entry) -> object:
    def bsa_memories() -> list[Entry]:
        return list(entries)

    return SimpleNamespace(bsa_memories=hookimpl(bsa_memories))


def entry(name: str = "elephant", **changes: object) -> Entry:
    return Entry(**{"name": name, "factory": object, "summary": "Forgets nothing.", "api": 1, **changes})  # type: ignore[arg-type]


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
        registry(plugin(entry())).find("memory", "elefant")


def reasons(found: Registry) -> list[str]:
    return [f"{item.kind or 'plugin'} {item.name} of {item.origin}: {item.reason}" for item in found.unusable]


def test_of_two_strangers_with_one_name_neither_is_preferred() -> None:
    found = registry(plugin(entry()), plugin(entry(), entry("ant")))
    assert found.names("memory") == ["ant"]
    with pytest.raises(BsaError, match=r"dist-0 1\.0: the name is also offered by dist-1 1\.1; dist-1 1\.1: the name"):
        found.find("memory", "elephant")


def test_a_built_in_name_stays_built_in() -> None:
    result = Registry()
    result.register(plugin(entry(summary="A stranger's.")), "memory", "zz-fault 0.1")
    result.register(plugin(entry(summary="Ours.")), "memory", "battery-sim-agent 9.9")
    assert result.collect().find("memory", "elephant").entry.summary == "Ours."
    assert reasons(result) == ["memory elephant of zz-fault 0.1: the name is taken by battery-sim-agent 9.9"]


def test_distributions_may_name_their_entry_points_alike() -> None:
    result = Registry()
    result.register(plugin(entry()), "memory", "first 1.0")
    result.register(plugin(entry("ant")), "memory", "second 2.0")
    assert result.collect().names("memory") == ["elephant", "ant"]
    assert result.unusable == []


class Unprintable:
    def __repr__(self) -> str:
        raise RuntimeError("no words")


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (entry("worm", api=99), "memory worm of dist-0 1.0: it was written for plugin interface 99, but this is"),
        (entry("worm", api="1"), "plugin interface '1'"),
        (entry("Bad Name"), "memory Bad Name of dist-0 1.0: the name 'Bad Name': use lower-case letters"),
        (entry(7), "plugin plugin-0 of dist-0 1.0: the name 7"),
        (entry("worm", factory=None), "its factory None cannot be called"),
        (entry("worm", summary=None), "its summary None is no text"),
        (entry("worm", config_type=dict), "no pydantic model"),
        (entry("worm", domain="biology"), "no bsa.core.domain.Domain"),
        ("not an entry", "it lists 'not an entry': yield bsa.core.hooks.Entry"),
        (Unprintable(), "it lists Unprintable"),
        (None, "it lists None"),
    ],
)
def test_an_entry_that_cannot_work_is_passed_over_with_its_reason(bad: object, words: str) -> None:
    found = registry(plugin(bad, entry()), plugin(entry("ant")))  # type: ignore[arg-type]
    assert found.names("memory") == ["elephant", "ant"]
    (reason,) = reasons(found)
    assert words in reason
    if "memory worm" in reason:
        with pytest.raises(BsaError, match=r'the memory "worm" cannot be used \(dist-0 1\.0: it'):
            found.find("memory", "worm")


def test_methods_that_would_never_be_called_are_reported_with_the_nearest_hook() -> None:
    def bsa_memorys() -> list[Entry]:
        return []

    def bsa_readers() -> list[Entry]:
        return []

    def bsa_effects(size: int) -> list[Entry]:
        return []

    typo = SimpleNamespace(bsa_memorys=hookimpl(bsa_memorys), bsa_memories=plugin(entry()).bsa_memories)  # type: ignore[attr-defined]
    found = registry(typo, SimpleNamespace(bsa_readers=bsa_readers), SimpleNamespace(bsa_effects=hookimpl(bsa_effects)))
    assert found.names("memory") == ["elephant"]
    assert '"bsa_memorys" is no hook: did you mean "bsa_memories"?' in reasons(found)[0]
    assert '"bsa_readers" is named as a hook and not marked: put @hookimpl above it' in reasons(found)[1]
    assert "Argument(s) {'size'} are declared in the hookimpl" in reasons(found)[2]


def test_what_was_listed_before_an_exception_counts() -> None:
    def bsa_memories() -> Iterator[Entry]:
        yield entry()
        raise ZeroDivisionError("boom")

    found = registry(SimpleNamespace(bsa_memories=hookimpl(bsa_memories)))
    assert found.names("memory") == ["elephant"]
    assert reasons(found) == ["plugin plugin-0 of dist-0 1.0: ZeroDivisionError: boom in bsa_memories"]


def test_who_looks_for_one_kind_is_not_told_of_the_faults_of_another() -> None:
    def bsa_readers() -> Iterator[Entry]:
        raise ZeroDivisionError("boom")

    found = registry(SimpleNamespace(bsa_readers=hookimpl(bsa_readers)), plugin(entry()))
    with pytest.raises(BsaError, match="boom"):
        found.find("reader", "zz")
    with pytest.raises(BsaError) as raised:
        found.find("memory", "zz")
    assert "boom" not in raised.value.hint


def test_ctrl_c_passes() -> None:
    def bsa_memories() -> list[Entry]:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        registry(SimpleNamespace(bsa_memories=hookimpl(bsa_memories)))


def test_a_factory_that_fails_is_named() -> None:
    def factory(options: Options) -> object:
        return {}["missing"]

    found = registry(plugin(entry(factory=factory)))
    with pytest.raises(BsaError, match=r"memory elephant of dist-0 1\.0: 'missing' in its factory\. Hint: KeyError at"):
        found.make("memory", "elephant", {})


def test_options_are_checked_against_the_configuration_type() -> None:
    found = registry(plugin(entry(config_type=Options)))
    assert found.configure("memory", "elephant", {"depth": 3}).depth == 3
    with pytest.raises(BsaError, match=r'"dept" is not a known key\. Hint: did you mean "depth"\?'):
        found.configure("memory", "elephant", {"dept": 3})
    with pytest.raises(BsaError, match='memory "elephant": "depth" is'):
        found.configure("memory", "elephant", {"depth": "deep"})


def test_a_factory_that_takes_other_arguments_is_named_with_its_place():
    class Lone:
        def __init__(self, options):
            pass

    registry = Registry()
    hook = hookimpl(lambda: [Entry("zz-lone", Lone, "Of a stranger.", api=1)])
    registry.register(SimpleNamespace(bsa_proposers=hook), "zz", "zz-fault 0.1")
    with pytest.raises(BsaError) as raised:
        registry.collect().make("proposer", "zz-lone", {}, object())
    assert raised.value.message.startswith(
        "proposer zz-lone of zz-fault 0.1: its factory is called with (options, context), which it does not take"
    )
    assert "Lone at test_registry.py, line " in raised.value.hint
