"""A language model reads the discrepancy and ranks effects; its words are untrusted, the statistics decide."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..contracts.reply_parsing import parse_object
from ..effect import Effect
from ..errors import BsaError
from ..messages import Backend, BackendFailure, BudgetSpent, Message, PromptRefused
from ..printable import strip_control

_SYSTEM = """You are an electrochemist. A physics-based lithium-ion cell model was fitted to measured records. \
A discrepancy remains that its parameters cannot explain. You get a list of effects that the model may lack, each \
with its equation and the signature that it leaves, and then the discrepancy, laid out in words. First say in two or \
three sentences what the discrepancy depends on: rate, time since a step, state of charge, temperature, rest, cycle. \
Then rank the three to five effects whose signatures agree with it best, the likeliest first, with one sentence of \
reason each. Use only names from the list. Answer with JSON only."""

_ANALYSIS_CHARS, _REASON_CHARS = 600, 300


@dataclass(frozen=True)
class Ranked:
    """One effect as the language model ranks it."""

    key: str
    reason: str  # Its words, shortened and without control characters.


@dataclass(frozen=True)
class Ranking:
    """What a language model said."""

    ranked: tuple[Ranked, ...]  # Likeliest first; only effects of the catalogue.
    analysis: str = ""  # What it thinks the discrepancy depends on, shortened and without control characters.
    note: str = ""  # What went wrong, if anything.
    # The name under which each effect was shown, by key; differs where names were hidden.
    shown_as: Mapping[str, str] | None = None
    lost: bool = False  # Whether that was an outage: the model did not answer, which says nothing about it.


def ask(
    backend: Backend, sentences: Sequence[str], effects: Sequence[Effect], seed: int, hide_names: bool = False
) -> Ranking:
    """Let a backend rank the effects, shown the discrepancy in words.

    With ``hide_names`` they are shown under names without meaning (``"effect-07"``) and without titles or
    citations, to learn whether the model reasons from signatures or recites names.
    """
    rng = np.random.default_rng(seed)
    # From the order of their names, so that the list tells nothing of what statistics think of its effects.
    known = sorted(effects, key=lambda effect: effect.key)
    order = [known[int(k)] for k in rng.permutation(len(known))]
    shown = {e.key: f"effect-{number:02d}" if hide_names else e.key for number, e in enumerate(order, start=1)}
    listing = [
        {"name": shown[e.key], "equation": e.equation, "signature": e.signature}
        | ({} if hide_names else {"title": e.title})
        for e in order
    ]
    schema = {
        "type": "object",
        "properties": {
            # First, for a model that is held to a schema token by token has no other place to think.
            "analysis": {"type": "string", "maxLength": _ANALYSIS_CHARS},
            "ranking": {
                "type": "array",
                "minItems": 1,
                "maxItems": 5,
                "items": {
                    "type": "object",
                    "properties": {
                        "name": {"type": "string", "enum": list(shown.values())},
                        "reason": {"type": "string", "maxLength": _REASON_CHARS},
                    },
                    "required": ["name", "reason"],
                    "additionalProperties": False,
                },
            },
        },
        "required": ["analysis", "ranking"],
        "additionalProperties": False,
    }
    content = json.dumps({"effects": listing, "discrepancy": list(sentences)}, indent=1)
    try:
        reply = backend.complete([Message("system", _SYSTEM), Message("user", content)], schema, seed=seed)
        answer = parse_object(reply.text, ("ranking",))
    except (BackendFailure, BudgetSpent, BsaError, ValueError) as error:
        note = f"the backend gave no usable ranking: {strip_control(str(error))[:200]}"
        lost = isinstance(error, BackendFailure) and not isinstance(error, PromptRefused)
        return Ranking((), note=note, shown_as=shown, lost=lost)
    by_shown = {name: key for key, name in shown.items()}
    reasons: dict[str, str] = {}
    rows = answer.get("ranking")
    for row in rows if isinstance(rows, list) else []:
        key = by_shown.get(str(row.get("name", "")).strip()) if isinstance(row, dict) else None
        if key is not None:
            reasons.setdefault(key, strip_control(str(row.get("reason", "")))[:_REASON_CHARS])
    ranked = tuple(Ranked(key, reason) for key, reason in list(reasons.items())[:5])
    analysis = strip_control(str(answer.get("analysis", "")))[:_ANALYSIS_CHARS]
    return Ranking(ranked, analysis, "" if ranked else "the reply named no effect of the list", shown)
