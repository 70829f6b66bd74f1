"""What was tried round by round: hypothesis, change, effect."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from markupsafe import escape

from ...core.parameters import ParameterSpace
from ...core.printable import strip_control
from ...core.proposal import ALREADY_SIMULATED, LACKING, PROBLEMS
from ...core.trial import Trial
from ..exchanges import Exchange
from ..run_record import Round, RunRecord
from .failures import failure_words
from .wording import change, clipped, factor, number, quantity, short_name

_TEXT = 2_500
_PROMPTS, _REPLIES, _LEAST = 500_000, 250_000, 400
"""Room for all prompts and for all replies of a page, in characters of HTML; a single text keeps at least the last."""

_SHOWN_CHANGES = 3

Printed = dict[str, Any]
"""A part of the page, its texts as they are printed."""


def chapters(run: RunRecord) -> list[Printed]:
    """Every round of a run, in order."""
    library = _Library(run)
    return [_chapter(round_, run.task.space, library) for round_ in run.rounds]


def changes(space: ParameterSpace, base: Trial, trial: Trial) -> list[Printed]:
    """What a trial changed against another, largest (as a share of the parameter's range, on its own scale) first."""
    found = []
    for parameter in space:
        before, after = base.candidate[parameter.name], trial.candidate[parameter.name]
        if abs(after - before) <= 1e-9 * max(abs(before), abs(after)):
            continue
        printed = {
            "name": short_name(parameter.name),
            "before": quantity(before, parameter.unit),
            "after": quantity(after, parameter.unit),
            "factor": factor(before, after),
        }
        found.append((abs(parameter.to_unit(after) - parameter.to_unit(before)), printed))
    return [printed for _, printed in sorted(found, key=lambda item: -item[0])]


def _chapter(round_: Round, space: ParameterSpace, library: _Library) -> Printed:
    best, start = round_.best, round_.changed_from
    several = len(round_.trials) > 1
    changed = changes(space, start, best) if best is not None and not several else []
    return {
        "title": f"Round {round_.number}" if round_.phase == "search" else "Warm-up",
        "verdict": _verdict(round_),
        "hypothesis": clipped(round_.hypothesis, _TEXT),
        "rationale": clipped(round_.rationale, _TEXT),
        "lost": clipped(round_.lost, _TEXT),
        "before": number(round_.base.objective),
        "after": "" if best is None or not best.ok else number(best.objective),
        "effect": change(round_.base.objective, best.objective) if best is not None else "",
        "failure": failure_words(best) if best is not None else "",
        "simulations": _simulations(round_),
        "main": changed[:_SHOWN_CHANGES],
        "other": changed[_SHOWN_CHANGES:],
        "against": "the best before"
        if round_.changed_from is round_.base
        else f"simulation {round_.changed_from.index}",
        "rows": [_row(space, start, trial) for trial in round_.trials] if several else [],
        "remarks": _remarks(round_),
        "calls": [library.call(exchange, first=place == 0) for place, exchange in enumerate(round_.exchanges)],
    }


def _verdict(round_: Round) -> str:
    if round_.lost:
        return "lost"
    if round_.best is None:
        return "stop" if round_.finished else "open"
    if not round_.best.ok:
        return "failed" if any(trial.failed for trial in round_.trials) else "explored"
    if round_.phase == "warm-up":
        return "explored"
    return "improved" if round_.improved else "worse"


def _simulations(round_: Round) -> str:
    indices = [trial.index for trial in round_.trials]
    if not indices:
        return ""
    return f"simulation {indices[0]}" if len(indices) == 1 else f"simulations {indices[0]} to {indices[-1]}"


def _row(space: ParameterSpace, base: Trial, trial: Trial) -> Printed:
    """One simulation of a round of several."""
    return {
        "index": trial.index,
        "changes": changes(space, base, trial)[:4],
        "objective": number(trial.objective),
        "failure": failure_words(trial),
        "reduced": "" if trial.reduction is None else f"ran {trial.reduction.words}",
    }


def _remarks(round_: Round) -> list[str]:
    details = round_.details
    remarks = []
    projected = details.get("projected")
    if isinstance(projected, list) and projected:
        names = ", ".join(short_name(str(name)) for name in projected)
        remarks.append(f"Kept inside its bounds: {clipped(names, 500)}.")
    if round_.trials and round_.changed_from is not round_.base:
        remarks.append(
            f"It changes simulation {round_.changed_from.index}, the present one to the model; the lowest error before "
            f"was that of simulation {round_.base.index}."
        )
    problems = details.get(PROBLEMS)
    # A lost round already gives them as its reason.
    if isinstance(problems, list) and problems and not round_.lost:
        remarks += [f"A reply was refused: {clipped(str(problem), 500)}" for problem in problems[:5]]
    remarks += [f"Simulation {new} repeats the values of simulation {old}." for new, old in round_.repeats.items()]
    if left_out := details.get(ALREADY_SIMULATED):
        remarks.append(f"Not simulated again: {left_out} of its candidates had been simulated.")
    if round_.finished and LACKING not in details:
        remarks.append("The proposer had nothing better to offer and asked to stop.")
    return remarks


_TITLES = {"model": "Prompt and reply", "vote": "Votes", "review": "Review"}


class _Library:
    """Prompts and replies, each text once, clipped so that the page stays light."""

    def __init__(self, run: RunRecord) -> None:
        self._seen: set[tuple[str, str]] = set()
        turns = {(turn.role, turn.text) for exchange in run.exchanges for turn in exchange.prompt}
        self._turn_room = _room([text for _, text in turns], _PROMPTS)
        self._reply_room = _room([exchange.text for exchange in run.exchanges], _REPLIES)

    def call(self, exchange: Exchange, first: bool) -> Printed:
        """One exchange; turns that were printed before are only named."""
        prompt = []
        for turn in exchange.prompt:
            key = (turn.role, turn.text)
            text = "" if key in self._seen else clipped(turn.text, self._turn_room)
            # On a second attempt the conversation so far stands right above.
            if first or key not in self._seen:
                prompt.append({"role": turn.role, "text": text, "images": turn.images, "repeated": key in self._seen})
            self._seen.add(key)
        return {
            "title": _TITLES[exchange.made_by],
            "prompt": prompt,
            "reply": clipped(_laid_out(exchange.text), self._reply_room),
            "lost": clipped(exchange.lost, _TEXT),
            "model": exchange.model,
            "tokens": exchange.usage.tokens,
            "seconds": exchange.usage.seconds,
            "notes": [clipped(note, 300) for note in exchange.notes[:10]],
        }


def _room(texts: Sequence[str], total: int) -> int:
    """Characters that each text may take so that all of them, escaped, stay within ``total``."""
    lengths = sorted(len(text) for text in texts)
    escaped = sum(len(escape(strip_control(text))) for text in texts)
    if escaped <= total or not lengths:
        return max(lengths, default=0)
    growth = escaped / max(sum(lengths), 1)
    left = total / growth
    for place, length in enumerate(lengths):
        share = left / (len(lengths) - place)
        if length > share:
            return max(int(share), _LEAST)
        left -= length
    return max(lengths)


def _laid_out(reply: str) -> str:
    """A reply that is plain JSON, indented; anything else as it came."""
    try:
        return json.dumps(json.loads(reply), indent=2, ensure_ascii=False)
    except (ValueError, RecursionError):
        return reply
