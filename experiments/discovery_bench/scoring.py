"""Opens the answers and counts: names right and wrong, gap closed, parameters' errors, cost."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .making import unseal
from .running import RESULTS


@dataclass(frozen=True)
class Marked:
    """One case with its mark.

    Attributes
    ----------
    case, setting : str
        Which case, and what it was for.
    hidden : tuple of str
        Names of what was hidden; an effect of no catalogue in brackets.
    verdict : str
        The discovery's verdict.
    named : tuple of str
        What it named.
    mark : {'right', 'ambiguous', 'partial', 'declined', 'wrong', 'failed'}
        ``ambiguous``: declared, with the hidden effect among those named; ``declined``: no name where there was
        something (no discrepancy seen, or unexplained); ``partial``: some of a pair.
    closed, held_closed : float
        Share of the gap closed on fitted and on held-out data.
    parameter_error : float or None
        Relative error of the strength, where the name is right.
    wall_s : float
        Wall time, s.
    simulations : int
        Single-record solves.
    """

    case: str
    setting: str
    hidden: tuple[str, ...]
    verdict: str
    named: tuple[str, ...]
    mark: str
    closed: float
    held_closed: float
    parameter_error: float | None
    wall_s: float
    simulations: int


def mark_cases(folder: Path, results: str = RESULTS) -> list[Marked]:
    """Mark every case that has a result."""
    answers = unseal(folder)
    rows = [json.loads(line) for line in (folder / results).read_text(encoding="utf-8").splitlines()]
    return [_mark(row, answers[row["case"]]) for row in sorted(rows, key=lambda row: row["case"])]


def _mark(row: dict[str, Any], answer: dict[str, Any]) -> Marked:
    hidden = tuple(sorted(set(answer["effects"]))) or ((f"[{answer['outside']}]",) if answer["outside"] else ())
    named = tuple(row["names"])
    verdict = row["verdict"]
    among = {hidden} & {named, *(tuple(r) for r in row.get("rivals", []))}
    if verdict == "failed":
        mark = "failed"
    elif not hidden:
        mark = "right" if verdict == "no-missing-effect" else "declined" if verdict == "unexplained" else "wrong"
    elif answer["outside"]:
        mark = "right" if verdict == "unexplained" else "declined" if verdict == "no-missing-effect" else "wrong"
    elif verdict in ("unexplained", "no-missing-effect"):
        mark = "declined"
    elif verdict == "ambiguous":
        mark = "ambiguous" if among else "wrong"
    else:
        mark = "right" if named == hidden else "partial" if set(named) < set(hidden) else "wrong"
    gap = row.get("gap", {})
    return Marked(
        row["case"],
        answer["setting"],
        hidden,
        verdict,
        named,
        mark,
        gap.get("closed", float("nan")) or 0.0,
        gap.get("holdout_closed", float("nan")) or 0.0,
        _parameter_error(row, answer) if mark == "right" and named else None,
        row["wall_s"],
        row.get("simulations", 0),
    )


def _parameter_error(row: dict[str, Any], answer: dict[str, Any]) -> float | None:
    errors = []
    for effect in row["effects"]:
        parameter = effect["parameters"][0]
        unit = f" [{parameter['unit']}]" if parameter["unit"] else ""
        true = answer["strengths"].get(f"{effect['name']}: {parameter['name']}{unit}")
        if true is not None and true != parameter["null"]:
            errors.append(abs(parameter["value"] - true) / abs(true - parameter["null"]))
    return max(errors) if errors else None


def as_markdown(marked: Sequence[Marked]) -> str:
    """The tables of ``docs/discovery.md``."""
    order = ("right", "ambiguous", "partial", "declined", "wrong", "failed")
    lines = ["| setting | cases | " + " | ".join(order) + " |", "| --- |" + " ---: |" * (len(order) + 1)]
    for setting in ("strong", "weak", "pair", "none", "outside"):
        some = [m for m in marked if m.setting == setting]
        counts = Counter(m.mark for m in some)
        if some:
            lines.append(f"| {setting} | {len(some)} | " + " | ".join(str(counts[k]) for k in order) + " |")
    lines += ["", "| hidden | named (cases) |", "| --- | --- |"]
    confusion: dict[str, Counter[str]] = {}
    for m in marked:
        said = " + ".join(m.named) + " (ambiguous)" * (m.verdict == "ambiguous") if m.named else m.verdict
        confusion.setdefault(" + ".join(m.hidden) or "nothing", Counter())[said] += 1
    for hidden, answers in sorted(confusion.items()):
        lines.append(f"| {hidden} | " + "; ".join(f"{name} ({count})" for name, count in answers.most_common()) + " |")
    right = [m for m in marked if m.mark == "right" and m.named]
    if right:
        errors = [m.parameter_error for m in right if m.parameter_error is not None]
        lines += [
            "",
            f"Where the name is right ({len(right)} cases): gap closed, median "
            f"{np.median([m.closed for m in right]):.3f}"
            f" (lowest {min(m.closed for m in right):.3f}) on fitted data,"
            f" {np.median([m.held_closed for m in right]):.3f} (lowest {min(m.held_closed for m in right):.3f})"
            f" on held-out data; error of the strength, median {np.median(errors):.1%}, largest {max(errors):.1%}.",
        ]
    times = [m.wall_s for m in marked]
    lines += [
        "",
        f"{len(marked)} cases; wall time a case: median {np.median(times):.0f} s, 10-90 % "
        f"{np.quantile(times, 0.1):.0f}-{np.quantile(times, 0.9):.0f} s; single-record solves: median "
        f"{np.median([m.simulations for m in marked]):.0f}.",
    ]
    return "\n".join(lines) + "\n"


def case_table(marked: Sequence[Marked]) -> str:
    """One line a case."""
    lines = ["| case | setting | hidden | verdict | named | mark | closed | held out | parameter error | s |"]
    lines.append("| --- |" * 1 + " --- |" * 5 + " ---: |" * 4)
    for m in marked:
        error = "" if m.parameter_error is None else f"{m.parameter_error:.1%}"
        lines.append(
            f"| {m.case} | {m.setting} | {' + '.join(m.hidden) or 'nothing'} | {m.verdict} | {' + '.join(m.named)} "
            f"| {m.mark} | {m.closed:.3f} | {m.held_closed:.3f} | {error} | {m.wall_s:.0f} |"
        )
    return "\n".join(lines) + "\n"
