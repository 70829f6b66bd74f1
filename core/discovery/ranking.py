"""A language model reads the discrepancy and ranks effects; its words are untrusted, the statistics decide."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..effect import Effect
from ..errors import BsaError
from ..messages import Backend, BackendFailure, BudgetSpent, Message
from ..reply_parsing import parse_object, strip_control

_SYSTEM = """You are an electrochemist. A physics-based lithium-ion cell model was fitted to measured records. \
A discrepancy remains that its parameters cannot explain. You get the discrepancy, laid out in words, and a list of \
effects that the model may lack, each with its equation and signature. Rank the three to five most likely effects, \
the likeliest first, with one sentence of reason each. Use only names from the list. Answer with JSON only."""


@dataclass(frozen=True)
class Ranked:
    """One effect as the language model ranks it.

    Attributes
    ----------
    key : str
        The effect's key.
    reason : str
        Its words, shortened and without control characters.
    """

    key: str
    reason: str


@dataclass(frozen=True)
class Ranking:
    """What a language model said.

    Attributes
    ----------
    ranked : tuple of Ranked
        Likeliest first; only effects of the catalogue.
    note : str
        What went wrong, if anything.
    shown_as : mapping of str to str
        The name under which each effect was shown, by key; differs where names were hidden.
    """

    ranked: tuple[Ranked, ...]
    note: str = ""
    shown_as: Mapping[str, str] | None = None


def ask(
    backend: Backend, sentences: Sequence[str], effects: Sequence[Effect], seed: int, hide_names: bool = False
) -> Ranking:
    """Let a backend rank the effects.

    Parameters
    ----------
    backend : Backend
        The language model.
    sentences : sequence of str
        The discrepancy in words.
    effects : sequence of Effect
        Those that the records can show.
    seed : int
        For the order of the list, the hidden names and sampling.
    hide_names : bool
        Show names without meaning (``"effect-07"``) and no titles or citations, to learn whether the model
        reasons from signatures or recites names.
    """
    rng = np.random.default_rng(seed)
    order = [effects[int(k)] for k in rng.permutation(len(effects))]
    shown = {e.key: f"effect-{number:02d}" if hide_names else e.key for number, e in enumerate(order, start=1)}
    listing = [
        {"name": shown[e.key], "equation": e.equation, "signature": e.signature}
        | ({} if hide_names else {"title": e.title})
        for e in order
    ]
    schema = {
        "type": "object",
        "properties": {
            "ranking": {
                "type": "array",
                "minItems": 1,
                "maxItems": 5,
                "items": {
                    "type": "object",
                    "properties": {
                        "name": {"type": "string", "enum": list(shown.values())},
                        "reason": {"type": "string", "maxLength": 300},
                    },
                    "required": ["name", "reason"],
                    "additionalProperties": False,
                },
            }
        },
        "required": ["ranking"],
        "additionalProperties": False,
    }
    content = json.dumps({"discrepancy": list(sentences), "effects": listing}, indent=1)
    try:
        reply = backend.complete([Message("system", _SYSTEM), Message("user", content)], schema, seed=seed)
        answer = parse_object(reply.text, ("ranking",))
    except (BackendFailure, BudgetSpent, BsaError, ValueError) as error:
        return Ranking((), f"the backend gave no usable ranking: {strip_control(str(error))[:200]}", shown)
    by_shown = {name: key for key, name in shown.items()}
    ranked: list[Ranked] = []
    rows = answer.get("ranking")
    for row in rows if isinstance(rows, list) else []:
        if not isinstance(row, dict):
            continue
        key = by_shown.get(str(row.get("name", "")).strip())
        if key is not None and key not in {r.key for r in ranked}:
            ranked.append(Ranked(key, strip_control(str(row.get("reason", "")))[:300]))
    return Ranking(tuple(ranked[:5]), "" if ranked else "the reply named no effect of the list", shown)
