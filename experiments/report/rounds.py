"""What was tried round by round: hypothesis, change, effect."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import escape

from ...core.parameters import ParameterSpace
from ...core.reply_parsing import strip_control
from ...core.trial import Trial
from ..exchanges import Exchange
from ..run_record import Round, RunRecord
from .failures import failure_words
from .wording import change, clipped, factor, number, quantity, short_name

_TEXT = 2_500
_PROMPTS, _REPLIES, _LEAST = 500_000, 250_000, 400
"""Room for all prompts and for all replies of a page, in characters of HTML; a single text keeps at least the last."""

_SHOWN_CHANGES = 3


@dataclass(frozen=True)
class Change:
    """One value that a candidate changed."""

    # name, before, after, factor: As they are printed.
    name: str
    before: str
    after: str
    factor: str
    weight: float  # Size of the change as a share of the parameter's range, on its own scale.


@dataclass(frozen=True)
class TrialRow:
    """One simulation of a round of several."""

    index: int
    changes: Sequence[Change]
    objective: str
    failure: str
    reduced: str = ""


@dataclass(frozen=True)
class Text:
    """A turn of a prompt, or where it was shown before."""

    role: str
    text: str
    images: int
    repeated: bool


@dataclass(frozen=True)
class Call:
    """One call of the language model, or what votes or a reviewer made of its reply."""

    title: str
    prompt: Sequence[Text]
    reply: str
    lost: str
    model: str
    tokens: int
    seconds: float
    notes: Sequence[str]


@dataclass(frozen=True)
class Chapter:
    """A round, ready to be printed."""

    title: str  # ``"Round 3"`` or ``"Warm-up"``.
    verdict: str  # What came of it. One of 'improved', 'worse', 'failed', 'lost', 'stop', 'open'.
    # hypothesis, rationale, lost: In the proposer's words.
    hypothesis: str
    rationale: str
    lost: str
    # before, after, effect: The best objective before, the round's own, and the relative change.
    before: str
    after: str
    effect: str
    failure: str
    simulations: str
    # main, other: The largest changes, and the rest.
    main: Sequence[Change]
    other: Sequence[Change]
    rows: Sequence[TrialRow]  # The simulations, where there are several.
    remarks: Sequence[str]  # Problems with replies, and values that were projected.
    calls: Sequence[Call]  # What was asked and answered.


def chapters(run: RunRecord) -> list[Chapter]:
    """Every round of a run, in order."""
    library = _Library(run)
    return [_chapter(round_, run.task.space, library) for round_ in run.rounds]


def changes(space: ParameterSpace, base: Trial, trial: Trial) -> list[Change]:
    """What a trial changed against another, largest first."""
    found = []
    for parameter in space:
        before, after = base.candidate[parameter.name], trial.candidate[parameter.name]
        if abs(after - before) <= 1e-9 * max(abs(before), abs(after)):
            continue
        found.append(
            Change(
                name=short_name(parameter.name),
                before=quantity(before, parameter.unit),
                after=quantity(after, parameter.unit),
                factor=factor(before, after),
                weight=abs(parameter.to_unit(after) - parameter.to_unit(before)),
            )
        )
    return sorted(found, key=lambda item: -item.weight)


def _chapter(round_: Round, space: ParameterSpace, library: _Library) -> Chapter:
    best = round_.best
    several = len(round_.trials) > 1
    changed = changes(space, round_.base, best) if best is not None and not several else []
    return Chapter(
        title=f"Round {round_.number}" if round_.phase == "search" else "Warm-up",
        verdict=_verdict(round_),
        hypothesis=clipped(round_.hypothesis, _TEXT),
        rationale=clipped(round_.rationale, _TEXT),
        lost=clipped(round_.lost, _TEXT),
        before=number(round_.base.objective),
        after="" if best is None or not best.ok else number(best.objective),
        effect=change(round_.base.objective, best.objective) if best is not None else "",
        failure=failure_words(best) if best is not None else "",
        simulations=_simulations(round_),
        main=changed[:_SHOWN_CHANGES],
        other=changed[_SHOWN_CHANGES:],
        rows=[_row(space, round_.base, trial) for trial in round_.trials] if several else [],
        remarks=_remarks(round_),
        calls=[library.call(exchange, first=place == 0) for place, exchange in enumerate(round_.exchanges)],
    )


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


def _row(space: ParameterSpace, base: Trial, trial: Trial) -> TrialRow:
    reduced = "" if trial.reduction is None else f"ran {trial.reduction.words}"
    return TrialRow(
        trial.index, changes(space, base, trial)[:4], number(trial.objective), failure_words(trial), reduced
    )


def _remarks(round_: Round) -> list[str]:
    details = round_.details
    remarks = []
    projected = details.get("projected")
    if isinstance(projected, list) and projected:
        names = ", ".join(short_name(str(name)) for name in projected)
        remarks.append(f"Kept inside its bounds: {clipped(names, 500)}.")
    problems = details.get("problems")
    # A lost round already gives them as its reason.
    if isinstance(problems, list) and problems and not round_.lost:
        remarks += [f"A reply was refused: {clipped(str(problem), 500)}" for problem in problems[:5]]
    if round_.finished:
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

    def call(self, exchange: Exchange, first: bool) -> Call:
        """One exchange; turns that were printed before are only named."""
        prompt = []
        for turn in exchange.prompt:
            key = (turn.role, turn.text)
            text = "" if key in self._seen else clipped(turn.text, self._turn_room)
            # On a second attempt the conversation so far stands right above.
            if first or key not in self._seen:
                prompt.append(Text(turn.role, text, turn.images, key in self._seen))
            self._seen.add(key)
        return Call(
            title=_TITLES[exchange.made_by],
            prompt=prompt,
            reply=clipped(_laid_out(exchange.text), self._reply_room),
            lost=clipped(exchange.lost, _TEXT),
            model=exchange.model,
            tokens=exchange.usage.tokens,
            seconds=exchange.usage.seconds,
            notes=[clipped(note, 300) for note in exchange.notes[:10]],
        )


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
