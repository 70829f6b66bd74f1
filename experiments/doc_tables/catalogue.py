"""Every table of the documentation by its name, as a marker in the Markdown gives it."""

from __future__ import annotations

from collections.abc import Callable

from . import discovery, published, studies
from .reach import reach
from .results import Results

TABLES: dict[str, Callable[[Results], str]] = {
    "reach": reach,
    "published": published.main,
    "published-summary": published.summary,
    "published-start": published.start,
    "published-oregan": published.oregan,
    "baselines": published.baselines,
    "noise": studies.noise,
    "warm-up": studies.warm_up,
    "discovery": discovery.blind_cases,
    "discovery-cases": discovery.each_case,
}
