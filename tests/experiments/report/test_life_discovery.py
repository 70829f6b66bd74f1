"""The page of a discovery over a life."""

from typing import Any

from bsa.experiments.report.life_discovery import render


def content(**changes: Any) -> dict[str, Any]:
    strength = {"name": "rate", "value": 12.0, "ci95": (10.0, 14.0), "unit": "", "null": 0.0, "at_bound": False}
    candidate = {"name": "sei-growth", "error": 1.2, "later_error": 1.4, "delta_bic": 41.3, "converged": True}
    candidate |= {"parameters": {"sei-growth": [strength]}, "rejected": "closes 12% of the gap <only>"}
    mode = {"name": "Loss of lithium inventory [%]", "cycles": (15, 80, 200), "values": (0.5, 2.0, 4.25)}
    mode |= {"half": (0.1, 0.1, 0.3), "per_100_cycles": 2.1, "half_per_100_cycles": 0.2}
    ohm = {**mode, "name": "Contact resistance [Ohm]"}
    found = {"verdict": "unexplained", "reason": "why", "effects": [], "rivals": [], "fit_cycles": 120}
    errors = {"base": {"error": 5.5, "later_error": 9.5}, "simulations": 77, "notes": ["a note"]}
    return {**found, **errors, "candidates": [candidate], "modes": [mode, ohm], **changes}


def test_the_page_has_verdict_mechanisms_and_modes() -> None:
    page = render(content())
    for text in ("verdict: unexplained", "77 simulations", "10 to 14", "closes 12% of the gap &lt;only&gt;", "a note"):
        assert text in page, text
    assert "Contact resistance [Ohm]" in page
    assert "4.25" in page or "4.3" in page
    assert "<svg" in page


def test_without_a_window_there_is_no_figure() -> None:
    page = render(content(modes=[]))
    assert "<svg" not in page


def test_what_was_named_stands_in_the_head() -> None:
    page = render(content(verdict="effect-found", effects=["sei-growth"]))
    assert "verdict: effect-found: sei-growth" in page
