"""Who puts the hidden effect on the shortlist: the score test, or a language model, with effects' names and without."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from ...core.discovery.ranking import ask
from ...core.effect import Effect
from ...core.messages import Backend, Outage
from ..campaign.summary import grouped
from ..campaign.text_tables import markdown_table
from ..discover import backend_or_none
from ..discovery_case import DiscoverOptions, read_case
from ..discovery_setup import set_up
from .results import read_results

SHORTLISTS = "shortlists"

_PLACES = (1, 3, 6)

HOW = {"named": False, "nameless": True}
"""A backend ranks twice: with the effects' names, and with names without meaning."""

_WORDS = {
    "statistics": "score test",
    "named": "backend, effects with their names",
    "nameless": "backend, names without meaning",
}
"""Who ranks, by the key of a row, in words."""


def shortlist(options: DiscoverOptions) -> dict[str, Any]:
    """Order the effects of one case by score, and let a backend rank them twice; nothing is fitted but the base model.

    Gives ``statistics``: keys of effects, the best first, none where the base model leaves noise only; ``named`` and
    ``nameless``: the backend's, where there is one and something to rank; ``possible`` and ``discrepancy``: the effects
    that the records can show, and what is to be explained, in words.
    """
    setup = set_up(read_case(options), options)
    known = setup.engine().shortlist()
    possible = [n for n in known.nominations if not n.lacks]
    found: dict[str, Any] = {
        "effects": len(possible),
        "statistics": [n.effect.key for n in possible if n.gain > 0],
        "possible": [n.effect.key for n in possible],
        "discrepancy": (setup.discrepancy(known.refitted) or []) if possible else [],
    }
    words = found["discrepancy"]
    # Where nothing is to be ranked no model is loaded.
    with backend_or_none(options) if possible else nullcontext() as backend:
        if backend is not None and words:
            found |= rankings(backend, words, [n.effect for n in possible], options.seed)
    firsts = (f"{how}: {found[how][0] if found[how] else 'none'}" for how in _WORDS if how in found)
    return found | {"summary": ", ".join(firsts)}


def rankings(
    backend: Backend, discrepancy: Sequence[str], effects: Sequence[Effect], seed: int
) -> dict[str, list[str]]:
    """Keys of effects as a backend ranks them, the best first; see `HOW`. Raises `Outage` if it could not be had."""
    found = {}
    for how, hidden in HOW.items():
        ranking = ask(backend, discrepancy, effects, seed, hidden)
        if ranking.lost:
            raise Outage(ranking.note)
        found[how] = [ranked.key for ranked in ranking.ranked]
    return found


def shortlist_places(folder: Path) -> list[dict[str, Any]]:
    """Open the answers, and find the place that each ranking gives the hidden effect: a row a case and ranking.

    Of the cases that hide one effect of the catalogue, those whose base model leaves noise only are left out: nothing
    was there to be ranked.
    """
    told = [(task, found, set(answer["names"])) for task, _, found, answer in read_results(folder, SHORTLISTS)]
    return [
        {"task": task, "ranked_by": words, "place": place_of(found[how], hidden)}
        for how, words in _WORDS.items()
        for task, found, hidden in told
        if found.get("effects") and how in found and len(hidden) == 1
    ]


def shortlist_table(places: Sequence[Mapping[str, Any]]) -> str:
    """How often each ranking has the hidden effect first, and among the first few."""
    lines = []
    for ranked_by, own in grouped(places, "ranked_by").items():
        counts = (sum(row["place"] <= k for row in own) for k in _PLACES)
        lines.append([ranked_by, str(len(own)), *map(str, counts)])
    heads = ["first" if k == 1 else f"among {k}" for k in _PLACES]
    return markdown_table(["ranked by", "cases", *heads], lines) + "\n"


def place_of(keys: Sequence[str], hidden: set[str]) -> float:
    """Place of the hidden effect among distinct names, variants of an effect being one; infinite if it is not there."""
    names = list(dict.fromkeys(key.split(" (")[0] for key in keys))
    return min((names.index(name) + 1.0 for name in hidden if name in names), default=float("inf"))
