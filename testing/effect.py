"""What an effect promises."""

from typing import Any

import numpy as np
import pytest

from ..core.contracts import products
from ..core.contracts.registry import installed
from ..core.effect import Effect, Evidence
from .entry import EntryConformance


class EffectConformance(EntryConformance):
    """Tests of an effect that need no simulator; a subclass gives the fixture ``name``."""

    kind = "effect"

    @pytest.fixture
    def effect(self, name: str, options: dict[str, Any]) -> Effect:
        """The effect."""
        return products.effect(installed().make("effect", name, options), name)

    def test_it_is_described(self, effect: Effect) -> None:
        """A report shows what is added, its signature and where the equation comes from."""
        assert all(text.strip() for text in (effect.title, effect.equation, effect.signature, effect.citation))

    def test_it_does_something(self, effect: Effect) -> None:
        """To the cell (``physics``) or to what the instrument shows (``measurement``)."""
        assert effect.physics is not None or effect.measurement is not None

    def test_its_parameters_can_be_searched(self, effect: Effect) -> None:
        """Different names, bounds around the null value and the probe, and a strength that the probe switches on."""
        names = [parameter.name for parameter in effect.parameters]
        assert len(set(names)) == len(names) == len(effect.searched)
        assert effect.strength.probe != effect.strength.null

    def test_an_instrument_without_it_shows_the_truth(self, effect: Effect) -> None:
        """At the null value clock and voltage are as they were; at the probe and the bounds they are finite."""
        if effect.measurement is None:
            return
        time, current = np.linspace(0.0, 3600.0, 50), np.repeat([0.0, 2.0], 25)
        voltage = 4.0 - 0.05 * current
        shown: dict[str, list[np.ndarray]] = {}
        for case in ("null", "probe", "lower", "upper"):
            values = {parameter.name: parameter.probe for parameter in effect.parameters}
            values[effect.strength.name] = getattr(effect.strength, case)
            clock, meter = effect.measurement.clock, effect.measurement.voltage
            shown[case] = [
                time if clock is None else np.asarray(clock(time, values)),
                voltage if meter is None else np.asarray(meter(voltage, current, values)),
            ]
            assert all(found.shape == time.shape and np.isfinite(found).all() for found in shown[case])
        assert shown["null"][0] == pytest.approx(time)
        assert shown["null"][1] == pytest.approx(voltage)
        assert not all(np.array_equal(*pair) for pair in zip(shown["null"], shown["probe"], strict=True))

    def test_it_says_in_words_what_the_records_lack(self, effect: Effect) -> None:
        """``lacks`` gives a text, empty where the records can show the effect."""
        for model in ("SPM", "SPMe", "DFN"):
            for cycles, span, sampling in ((1, 0.0, 60.0), (200, 20.0, 0.1)):
                evidence = Evidence(model, {}, cycles, span, sampling)
                assert effect.lacks is None or isinstance(effect.lacks(evidence), str)
