"""The built-in backends. Factories import their libraries when called, so that listing stays fast."""

from __future__ import annotations

from collections.abc import Iterable

from ..core.hooks import Entry, hookimpl


@hookimpl
def bsa_backends() -> Iterable[Entry]:
    """Everything that answers behind the one method of `Backend`."""
    from .rules.backend import RulesBackend

    yield Entry("rules", RulesBackend, "A deterministic reasoner that reads the prompt; needs no model.")
