"""Opens the answers and counts: names right and wrong, gap closed, parameters' errors, cost."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import BsaError
from ..campaign.summary import exact_interval
from .making import read_rows, unseal
from .running import RESULTS


@dataclass(frozen=True)
class Marked:
    """One case with its mark.

    Attributes
    ----------
    task, setting : str
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
    wall_s, cpu_s : float
        Wall time and processor time of the case's process, s.
    simulations : float
        Single-record solves.
    """

    task: str
    setting: str
    hidden: tuple[str, ...]
    verdict: str
    named: tuple[str, ...]
    mark: str
    closed: float
    held_closed: float
    parameter_error: float | None
    wall_s: float
    cpu_s: float
    simulations: float


def mark_cases(folder: Path, results: str = RESULTS) -> list[Marked]:
    """Mark every case that has a result."""
    answers = unseal(folder)
    rows = read_rows(folder, results)
    unknown = [row["case"] for row in rows if row["case"] not in answers]
    if unknown:
        raise BsaError(
            f"the results in {folder} are of a case that it has not: {unknown[0]!r}.", "make the cases anew."
        )
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
        row.get("cpu_s", row["wall_s"]),
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


def marked_row(marked: Marked) -> dict[str, Any]:
    """A case as a flat row, for CSV."""
    return {**asdict(marked), "hidden": " + ".join(marked.hidden), "named": " + ".join(marked.named)}


def marked_of(row: Mapping[str, Any]) -> Marked:
    """The case of a row that `marked_row` made and `read_csv` read."""
    error = row["parameter_error"]
    texts = {name: tuple(row[name].split(" + ")) if isinstance(row[name], str) else () for name in ("hidden", "named")}
    return Marked(**{**row, **texts, "parameter_error": None if math.isnan(error) else error})


_MARKS = ("right", "ambiguous", "partial", "declined", "wrong", "failed")
_SETTINGS = ("strong", "weak", "pair", "none", "outside")


def as_markdown(marked: Sequence[Marked]) -> str:
    """The tables of ``docs/discovery-results.md``: marks by setting, confusion matrix, rates, gap, parameters, cost."""
    lines = ["| setting | cases | " + " | ".join(_MARKS) + " |", "| --- |" + " ---: |" * (len(_MARKS) + 1)]
    for setting in _SETTINGS:
        some = [m for m in marked if m.setting == setting]
        counts = Counter(m.mark for m in some)
        if some:
            lines.append(f"| {setting} | {len(some)} | " + " | ".join(str(counts[k]) for k in _MARKS) + " |")
    lines += ["", *_confusion(marked), "", *_rates(marked), *_sizes(marked), *_cost(marked)]
    return "\n".join(lines) + "\n"


def _confusion(marked: Sequence[Marked]) -> list[str]:
    """What was hidden against what was said; the setting is told apart, since weak effects are harder."""
    table: dict[tuple[str, str], Counter[str]] = {}
    for m in marked:
        said = " + ".join(m.named) + " (ambiguous)" * (m.verdict == "ambiguous") if m.named else m.verdict
        hidden = " + ".join(m.hidden) or "nothing"
        table.setdefault((hidden, m.setting), Counter())[said] += 1
    lines = ["| hidden | setting | said (cases) |", "| --- | --- | --- |"]
    for (hidden, setting), answers in sorted(table.items()):
        said = "; ".join(f"{name} ({count})" for name, count in answers.most_common())
        lines.append(f"| {hidden} | {setting} | {said} |")
    return lines


def _rates(marked: Sequence[Marked]) -> list[str]:
    lines = []
    for setting in ("strong", "weak"):
        some = [m for m in marked if m.setting == setting]
        right = sum(m.mark == "right" for m in some)
        clear = [m for m in some if m.verdict != "ambiguous"]
        told = [m for m in clear if m.verdict != "no-missing-effect"]
        if some:
            lines.append(
                f"* {setting}: the right name in {right} of {len(some)} cases; in {right} of {len(clear)} without "
                f"those declared ambiguous; in {right} of {len(told)} without those, too, whose base model leaves "
                f"noise only."
            )
    for setting, words in (("none", "nothing hidden"), ("outside", "an effect of no catalogue")):
        some = [m for m in marked if m.setting == setting]
        if some:
            lines.append(f"* {words}: a name was given in {_share(sum(bool(m.named) for m in some), len(some))}.")
    lines.append(f"* wrong names in all: {_share(sum(m.mark == 'wrong' for m in marked), len(marked))}.")
    return lines


def _share(count: int, of: int) -> str:
    return f"{count} of {of} cases" + (f" ({exact_interval(count, of)})" if of else "")


def _sizes(marked: Sequence[Marked]) -> list[str]:
    right = [m for m in marked if m.mark == "right" and m.named]
    if not right:
        return []
    lines = []
    for words, values in (
        ("fitted", [m.closed for m in right]),
        ("held-out", [m.held_closed for m in right]),
    ):
        low, middle, high = np.quantile(values, (0.1, 0.5, 0.9))
        lines.append(
            f"* gap closed on {words} data where the name is right: median {middle:.3f}, 10-90 % {low:.3f} "
            f"to {high:.3f} ({len(right)} cases)."
        )
    errors = np.array([m.parameter_error for m in right if m.parameter_error is not None])
    if len(errors):
        lines.append(
            f"* error of the strength: median {np.median(errors):.1%}, largest {np.max(errors):.0%}, "
            f"within 10 % in {np.sum(errors <= 0.1)} of {len(errors)} cases."
        )
    return lines


def _cost(marked: Sequence[Marked]) -> list[str]:
    ran = [m for m in marked if m.mark != "failed"]
    lines = []
    for words, values, unit in (
        ("single-record solves a case", [float(m.simulations) for m in ran], ""),
        ("processor time a case, one process", [m.cpu_s for m in ran], " s"),
        ("wall time a case", [m.wall_s for m in ran], " s"),
    ):
        known = [value for value in values if not math.isnan(value)]
        if known:
            low, middle, high = np.quantile(known, (0.1, 0.5, 0.9))
            shares = f"median {middle:.0f}{unit}, 10-90 % {low:.0f} to {high:.0f}{unit}"
            lines.append(f"* {words}: {shares} ({len(known)} cases).")
    return lines


def case_table(marked: Sequence[Marked]) -> str:
    """One line a case."""
    lines = ["| case | setting | hidden | verdict | named | mark | closed | held out | parameter error | processor s |"]
    lines.append("| --- |" * 1 + " --- |" * 5 + " ---: |" * 4)
    for m in marked:
        error = "" if m.parameter_error is None else f"{m.parameter_error:.1%}"
        lines.append(
            f"| {m.task} | {m.setting} | {' + '.join(m.hidden) or 'nothing'} | {m.verdict} | {' + '.join(m.named)} "
            f"| {m.mark} | {m.closed:.3f} | {m.held_closed:.3f} | {error} | {m.cpu_s:.0f} |"
        )
    return "\n".join(lines) + "\n"
