"""Effects of strangers: made with their options, passed over where they cannot be used and nobody named them."""

from types import SimpleNamespace
from typing import Any

import pytest
from bsa.core.contracts.effect_choice import effects_of
from bsa.core.contracts.registry import Registry, installed
from bsa.core.effect import Effect, EffectParameter, Evidence
from bsa.core.errors import BsaError
from bsa.core.hooks import Entry, hookimpl
from pydantic import BaseModel, Field

EVIDENCE = Evidence("DFN", {}, 1, 0.0, 1.0)


class Options(BaseModel, extra="forbid"):
    probe: float = Field(0.1, gt=0, description="Where a refit starts.")


def effect(name: str = "zz-drag", **changes: Any) -> Effect:
    strength = EffectParameter("size", "Ohm", 0.0, 0.0, 1.0, changes.pop("probe", 0.1))
    given = {"title": "Drag", "equation": "V - s I", "parameters": (strength,), "signature": "s", "citation": "c"}
    return Effect(name, **{**given, **changes})


def registry(**factories: Any) -> Registry:
    entries = [
        Entry(name.replace("_", "-"), factory, "Of a stranger.", Options, api=1) for name, factory in factories.items()
    ]
    result = Registry()
    result.register(SimpleNamespace(bsa_effects=hookimpl(lambda: entries)), "zz", "zz-fault 0.1")
    return result.collect()


def test_the_catalogue_is_whole() -> None:
    notes: list[str] = []
    listed = [listing.entry.name for listing in installed().listings("effect")]
    on_request = effects_of(["ocp-shape", "slow-active-material", "resistive-reactant"])
    assert len(effects_of(None, note=notes.append)) + len(on_request) == len(listed)
    assert all(effect.on_request for effect in on_request)
    assert notes == []


def test_options_reach_the_effects_that_have_them() -> None:
    found = registry(zz_drag=lambda options: effect(probe=options.probe))
    assert effects_of(None, found)[0].strength.probe == 0.1
    for key in ("zz-drag.probe", "probe"):
        assert effects_of(None, found, {key: 0.4})[0].strength.probe == 0.4
    with pytest.raises(BsaError, match=r'effect "zz-drag": "prob" is not a known key\. Hint: did you mean "probe"\?'):
        effects_of(None, found, {"zz-drag.prob": 0.4})
    with pytest.raises(BsaError, match=r'no effect has an option "prob"\. Hint: did you mean "probe"\?'):
        effects_of(None, found, {"prob": 0.4})
    with pytest.raises(BsaError, match=r'no effect "zz-dragg" .*did you mean "zz-drag"\?'):
        effects_of(None, found, {"zz-dragg.probe": 0.4})


@pytest.mark.parametrize("name", ["ocp-shape (negative electrode)", "ocp-shape.negative-electrode"])
def test_a_variant_is_called_as_it_is_reported_or_listed(name: str) -> None:
    assert [effect.key for effect in effects_of([name])] == ["ocp-shape (negative electrode)"]


def fails(options: Options) -> Effect:
    raise RuntimeError("boom")


@pytest.mark.parametrize(
    ("factory", "words"),
    [
        (fails, "boom in its factory"),
        (lambda options: None, "its factory returned None, not an Effect"),
        (lambda options: effect("other"), 'its factory returned the effect "other"'),
        (lambda options: effect("zz-worm", parameters=()), "an effect without parameters"),
        (
            lambda options: effect("zz-worm", parameters=(1.0,)),
            "a parameter that is 1.0 (float), not an EffectParameter",
        ),
        (lambda options: effect("zz-worm", title=None), "Effect.title = None, not a str"),
    ],
)
def test_an_effect_that_cannot_be_used_stops_only_who_names_it(factory: Any, words: str) -> None:
    notes: list[str] = []
    found = registry(zz_worm=factory, zz_drag=lambda options: effect())
    assert [e.name for e in effects_of(None, found, note=notes.append)] == ["zz-drag"]
    assert [e.name for e in effects_of(["zz-drag"], found)] == ["zz-drag"]
    assert words in notes[0]
    assert "effect zz-worm of zz-fault 0.1" in notes[0]
    with pytest.raises(BsaError, match=r"effect zz-worm of zz-fault 0\.1"):
        effects_of(["zz-worm"], found)


def test_an_effect_of_another_interface_is_named_where_it_is_used() -> None:
    result = Registry()
    old = Entry("zz-old", effect, "Old.", api=0)
    result.register(SimpleNamespace(bsa_effects=hookimpl(lambda: [old])), "zz", "zz-fault 0.1")
    with pytest.raises(BsaError, match=r"zz-fault 0\.1: it was written for plugin interface 0"):
        effects_of(["zz-old"], result.collect())


def test_an_effect_that_cannot_say_what_it_needs_counts_as_one_that_cannot_be_shown() -> None:
    def lacks(evidence: Evidence) -> str:
        raise ZeroDivisionError("boom")

    (found,) = effects_of(None, registry(zz_drag=lambda options: effect(lacks=lacks)))
    assert found.lacks is not None
    assert found.lacks(EVIDENCE) == "effect zz-drag of zz-fault 0.1: boom in lacks."
