"""Tables of graded blind cases."""

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from ..campaign.summary import exact_interval
from ..campaign.text_tables import Entry, markdown_table, table_of
from .grading import Graded

GRADES = ("right", "ambiguous", "partial", "declined", "wrong", "failed")
_SETTINGS = ("single", "strong", "weak", "pair", "none", "outside")


def as_markdown(graded: Sequence[Graded]) -> str:
    """The tables of a campaign: grades by setting, confusion, rates, gap, parameters, cost."""
    lines = [by_setting(graded), "", _confusion(graded), "", *_rates(graded), *_sizes(graded), *_cost(graded)]
    return "\n".join(lines) + "\n"


def by_setting(graded: Sequence[Graded]) -> str:
    """How many cases of each setting have which grade."""
    some = {setting: [m for m in graded if m.setting == setting] for setting in _SETTINGS}
    lines = [[setting, *grade_counts(cases)] for setting, cases in some.items() if cases]
    return markdown_table(["setting", "cases", *GRADES], lines)


def grade_counts(graded: Sequence[Graded]) -> list[str]:
    """The number of cases, and how many have each of `GRADES`."""
    found = Counter(m.grade for m in graded)
    return [str(len(graded)), *(str(found[grade]) for grade in GRADES)]


def answers(graded: Sequence[Graded]) -> str:
    """What was said of these cases, and of how many each: ``"time-lag (2); unexplained (1)"``."""
    found = Counter(_named(m) + " (ambiguous)" * (m.verdict == "ambiguous") if m.named else m.verdict for m in graded)
    return "; ".join(f"{said} ({count})" for said, count in found.most_common())


def _confusion(graded: Sequence[Graded]) -> str:
    """What was hidden against what was said; the setting is told apart, since weak effects are harder."""
    table: dict[tuple[str, str], list[Graded]] = {}
    for m in graded:
        table.setdefault((hidden_words(m), m.setting), []).append(m)
    lines = [[*key, answers(some)] for key, some in sorted(table.items())]
    return markdown_table(["hidden", "setting", "said (cases)"], lines, 3)


def hidden_words(m: Graded) -> str:
    """What a case hides, in words."""
    return " + ".join(m.hidden) or "nothing"


def _named(m: Graded) -> str:
    return " + ".join(m.named)


def _rates(graded: Sequence[Graded]) -> list[str]:
    lines = [line for setting in ("strong", "weak") for line in _of_setting(graded, setting)]
    models = [model for model in dict.fromkeys(m.model for m in graded) if model]
    lines += _detected(graded, "all models")
    for model in models if len(models) > 1 else ():
        lines += _detected([m for m in graded if m.model == model], model)
    # A case that failed has said nothing, right or wrong.
    ran = [m for m in graded if m.grade != "failed"]
    nulls = [m for m in ran if m.setting == "none"]
    outside = [m for m in ran if m.setting == "outside"]
    for some, words in ((nulls, "nothing hidden"), (outside, "an effect of no catalogue")):
        if some:
            lines.append(f"* {words}: a name was given in {_share(sum(bool(m.named) for m in some), len(some))}.")
    if nulls:
        clean = sum(m.verdict == "no-missing-effect" for m in nulls)
        lines.append(f"* nothing hidden: the verdict is `no-missing-effect` in {_share(clean, len(nulls))}.")
    lines.append(f"* wrong names in all: {_share(sum(m.grade == 'wrong' for m in ran), len(ran))}.")
    told = [m.covered for m in graded if m.covered is not None]
    if told:
        inside = sum(share == 1.0 for share in told)
        lines.append(f"* strengths inside their 95 % intervals, where the name is right: {_share(inside, len(told))}.")
    return lines


def _of_setting(graded: Sequence[Graded], setting: str) -> list[str]:
    some = [m for m in graded if m.setting == setting]
    if not some:
        return []
    right = sum(m.grade == "right" for m in some)
    clear = [m for m in some if m.verdict != "ambiguous"]
    told = [m for m in clear if m.verdict != "no-missing-effect"]
    return [
        f"* {setting}: the right name in {right} of {len(some)} cases; in {right} of {len(clear)} without those "
        f"declared ambiguous; in {right} of {len(told)} without those, too, whose base model leaves noise only."
    ]


def _detected(graded: Sequence[Graded], words: str) -> list[str]:
    """How many of the effects that can be detected at all are named."""
    known = [m for m in graded if m.evidence is not None]
    some = [m for m in known if m.detectable]
    if not known:
        return []
    named = sum(m.grade == "right" for m in some)
    return [
        f"* {words}: {len(some)} of {len(known)} hidden effects are detectable (odds of the truth over the base fit "
        f"above 20 to 1); the right name is given in {_share(named, len(some))} of these."
    ]


def _share(count: int, of: int) -> str:
    return f"{count} of {of} cases" + (f" ({exact_interval(count, of)})" if of else "")


def _sizes(graded: Sequence[Graded]) -> list[str]:
    right = [m for m in graded if m.grade == "right" and m.named]
    if not right:
        return []
    lines = []
    for words, values in (("fitted", [m.closed for m in right]), ("held-out", [m.held_closed for m in right])):
        lines += _quantiles(f"gap closed on {words} data where the name is right", values, ".3f")
    errors = np.array([m.parameter_error for m in right if m.parameter_error is not None])
    if len(errors):
        lines.append(
            f"* error of the strength: median {np.median(errors):.1%}, largest {np.max(errors):.0%}, "
            f"within 10 % in {np.sum(errors <= 0.1)} of {len(errors)} cases."
        )
    return lines


def _cost(graded: Sequence[Graded]) -> list[str]:
    ran = [m for m in graded if m.grade != "failed"]
    return [
        *_quantiles("single-record solves a case", [m.simulations for m in ran], ".0f"),
        *_quantiles("processor time a case, one process", [m.cpu_s for m in ran], ".0f", " s"),
        *_quantiles("wall time a case", [m.wall_s for m in ran], ".0f", " s"),
    ]


def _quantiles(words: str, values: Sequence[float], form: str, unit: str = "") -> list[str]:
    """A line with the median and the spread of the values that are known; none where there are none."""
    known = [value for value in values if not math.isnan(value)]
    if not known:
        return []
    low, middle, high = np.quantile(known, (0.1, 0.5, 0.9))
    spread = f"10-90 % {low:{form}} to {high:{form}}{unit}"
    return [f"* {words}: median {middle:{form}}{unit}, {spread} ({len(known)} cases)."]


def _known(share: float) -> str:
    return "" if math.isnan(share) else f"{share:.3f}"


def case_table(graded: Sequence[Graded]) -> str:
    """One line a case."""
    columns: dict[str, Entry] = {
        "case": "{task}",
        "setting": "{setting}",
        "hidden": hidden_words,
        "verdict": "{verdict}",
        "named": _named,
        "grade": "{grade}",
        "closed": lambda m: _known(m.closed),
        "held out": lambda m: _known(m.held_closed),
        "parameter error": lambda m: "" if m.parameter_error is None else f"{m.parameter_error:.1%}",
        "processor s": lambda m: "" if math.isnan(m.cpu_s) else f"{m.cpu_s:.0f}",
    }
    return table_of(graded, columns, 6) + "\n"
