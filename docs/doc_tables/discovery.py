"""Tables of discovery: the blind cases, who finds an effect without a fit, and measured cells."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from bsa.core.errors import BsaError
from bsa.experiments.campaign.summary import exact_interval, grouped
from bsa.experiments.campaign.text_tables import Entry, brief, markdown_table, table_of
from bsa.experiments.discovery_bench.grading import Graded, graded_of
from bsa.experiments.discovery_bench.repeats import repeats_table
from bsa.experiments.discovery_bench.sensitivity import sensitivity_table
from bsa.experiments.discovery_bench.tables import GRADES, answers, by_setting, grade_counts, hidden_words

from .results import ORIGINS, Results

BLIND = "discovery_blind"
"""File of the cases that are drawn from the seed."""

MEASURED = "discovery_hidden"
"""File of the cases that are hidden in measured records."""

EARLIER = "discovery_cases discovery_earlier"
"""Files of the earlier set: cases run last, and those whose rows are an earlier version's."""

RESOLVED = "20261201"
"""The first seed whose hidden cells have a mesh that is fine enough."""

_BRACKETS = "In brackets: exact 95 % intervals of shares"

_ALONE = "without a reference"

_WAYS = (_ALONE, "beside one reference", "beside two references")
"""In words, how many references a case has."""

_NONE = "–"
"""Stands where a figure does not apply."""


def summary(results: Results) -> str:
    """Every set of graded cases in a line."""
    blind = graded(results, BLIND)
    sets = {
        "fresh seeds": blind,
        f"of these, from seed {RESOLVED} on (finer hidden cells)": [case for case in blind if _resolved(case)],
        **{f"hidden in measured records, {way}": some for way, some in _by_references(results).items()},
        "earlier set, not fully blind": graded(results),
    }
    heads = ["set", "cases", *GRADES[:-2], "wrong (exact 95 % interval)", "failed", "hidden effects named"]
    return _grade_table(heads, [[words, *_summed(some)] for words, some in sets.items()], 1)


def _grade_table(heads: Sequence[str], lines: Sequence[Sequence[str]], text_columns: int) -> str:
    """A table with a column for each grade; that of failed cases is left out where no case failed."""
    kept = [place for place, head in enumerate(heads) if head != "failed" or any(line[place] != "0" for line in lines)]
    heads, *lines = ([cells[place] for place in kept] for cells in (heads, *lines))
    return markdown_table(heads, lines, text_columns)


def _summed(cases: Sequence[Graded]) -> list[str]:
    *counts, wrong, failed = grade_counts(cases)
    named = _of([case.grade == "right" for case in cases if case.setting not in ("none", "outside")])
    # A case that failed has said nothing, right or wrong.
    return [*counts, f"{wrong} ({_interval(int(wrong), len(cases) - int(failed))})", failed, named]


def _resolved(case: Graded) -> bool:
    return _seed(case) >= RESOLVED


def _seed(case: Graded) -> str:
    return case.task.partition(" ")[0]


def _of(kept: Sequence[bool]) -> str:
    return f"{sum(kept)} of {len(kept)}" if kept else _NONE


def aims(results: Results) -> str:
    """The aims, and in how many cases they are kept."""
    blind, earlier = graded(results, BLIND), graded(results)

    def told(cases: Sequence[Graded], setting: str) -> str:
        some = [case for case in cases if case.setting == setting]
        return _of([case.grade == "right" for case in some if case.verdict not in ("ambiguous", "no-missing-effect")])

    def sizes(cases: Sequence[Graded]) -> list[str]:
        named = [case for case in cases if case.grade == "right" and case.named]
        return [
            _of([case.closed >= 0.95 for case in named if not math.isnan(case.closed)]),
            _of([case.held_closed >= 0.9 for case in named if not math.isnan(case.held_closed)]),
            _of([case.parameter_error <= 0.1 for case in named if case.parameter_error is not None]),
            _of([case.wall_s <= 300.0 for case in cases if not math.isnan(case.wall_s)]),
        ]

    lines = [
        ["right name, strong effects that can be told", "95 %", _NONE, told(earlier, "strong")],
        ["right name, weak effects that can be told", "80 %", _NONE, told(earlier, "weak")],
        ["right name, detectable effects of any strength", _NONE, _detectable(blind), _NONE],
    ]
    kept = (
        ("gap closed on fitted data, where the name is right", "at least 0.95"),
        ("gap closed on held-out data, where the name is right", "at least 0.9"),
        ("error of the strength, where the name is right", "at most 10 %"),
        ("wall time on two cores", "at most 5 min"),
    )
    lines += [[*words, *found] for words, *found in zip(kept, sizes(blind), sizes(earlier), strict=True)]
    return markdown_table(["what", "aim", "kept, fresh seeds", "kept, earlier set"], lines, 2)


def _detectable(cases: Sequence[Graded]) -> str:
    """How many of the detectable effects are named."""
    return _of([case.grade == "right" for case in cases if case.detectable])


def blind_cases(results: Results) -> str:
    """Grades by seed, what was said of what, rates, gap, strengths and cost."""
    cases = graded(results, BLIND)
    return results.framed(BLIND, _by_seed(results, cases), _said(cases), _figures(cases))


def _by_seed(results: Results, cases: Sequence[Graded]) -> str:
    """Grades by seed, with the version that ran the cases; raises `BsaError` if the origins lack a seed."""
    versions = results.origin(BLIND).version
    known = versions if isinstance(versions, dict) else {}
    own = _grouped(cases, _seed)
    if missing := own.keys() - known.keys():
        where, seeds = results.folder / ORIGINS, ", ".join(sorted(missing))
        raise BsaError(f"{where} does not say which version ran seed {seeds}.", "give its version beside the seed.")
    lines = [[seed, known[seed], *_counted(some)] for seed, some in own.items()]
    for words, late in ((f"before {RESOLVED}", False), (f"from {RESOLVED} on", True)):
        lines.append([words, "", *_counted([case for case in cases if _resolved(case) is late])])
    heads = ["seed", "version", "cases", *GRADES, "detectable effects named"]
    return _grade_table(heads, lines, 2)


def _counted(cases: Sequence[Graded]) -> list[str]:
    return [*grade_counts(cases), _detectable(cases)]


def _said(cases: Sequence[Graded]) -> str:
    """What was said of what is hidden."""
    lines = [[name, answers(some)] for name, some in sorted(_grouped(cases, hidden_words).items())]
    return markdown_table(["hidden", "said (cases)"], lines, 2)


def _grouped(cases: Iterable[Graded], key: Callable[[Graded], str]) -> dict[str, list[Graded]]:
    found: dict[str, list[Graded]] = {}
    for case in cases:
        found.setdefault(key(case), []).append(case)
    return found


def _figures(cases: Sequence[Graded]) -> str:
    """Rates, gap, strengths and cost of the blind cases."""
    models = {model: [case for case in cases if case.model == model] for model in ("SPMe", "DFN", "SPM")}
    shares = [
        f"{words} {_share([case.grade == 'right' for case in some if case.detectable])}"
        for words, some in {"all models": cases, **models}.items()
    ]
    settings = [
        f"{words} {_share([case.grade == 'right' for case in cases if case.setting == setting])}"
        for setting, words in _SETTINGS.items()
    ]
    right = [case for case in cases if case.grade == "right" and case.named]
    errors = [case.parameter_error for case in cases if case.parameter_error is not None]
    hiding = [case for case in cases if case.evidence is not None]
    lines = [
        f"{_of([case.detectable for case in hiding])} hidden effects are detectable. Of these are named: "
        f"{'; '.join(shares)}.",
        f"Right: {'; '.join(settings)}.",
        "Where the name is right: the median share of the gap that is closed is "
        f"{_quantiles([case.closed for case in right])} on fitted data and "
        f"{_quantiles([case.held_closed for case in right])} on held-out data; the strength lies inside its 95 % "
        f"interval in {_share([case.covered == 1.0 for case in cases if case.covered is not None])}; its error is "
        f"{np.median(errors):.1%} in the median and {max(errors):.0%} at most.",
        f"A case takes in the median {_quantiles([case.simulations for case in cases], 0)} single-record solves, "
        f"{_quantiles([case.cpu_s for case in cases], 0)} s of processor time in one process, and "
        f"{_quantiles([case.wall_s for case in cases], 0)} s of wall time.",
    ]
    return "\n".join(f"* {line}" for line in lines) + f"\n\n{_BRACKETS}, and 10-90 % of the cases beside medians."


_SETTINGS = {
    "single": "one effect hidden",
    "pair": "two effects",
    "none": "nothing hidden",
    "outside": "an effect of no catalogue",
}


def _share(kept: Sequence[bool]) -> str:
    return f"{_of(kept)} ({_interval(sum(kept), len(kept))})" if kept else _NONE


def _interval(count: int, of: int) -> str:
    return exact_interval(count, of).removeprefix("exact 95 % interval ")


def _quantiles(values: Sequence[float], digits: int = 3) -> str:
    low, middle, high = np.nanquantile(values, (0.1, 0.5, 0.9))
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def in_measured(results: Results) -> list[tuple[str, str, Graded]]:
    """Cell, reference (empty without one) and grade of each case that is hidden in measured records."""
    rows = [(row.pop("cell"), row.pop("beside"), graded_of(row)) for row in results.rows(MEASURED)]
    return [(cell, beside if isinstance(beside, str) else "", case) for cell, beside, case in rows]


def _by_references(results: Results) -> dict[str, list[Graded]]:
    """The cases of measured records by the number of references, in words."""
    found: dict[str, list[Graded]] = {way: [] for way in _WAYS}
    for _, beside, case in in_measured(results):
        found[_WAYS[bool(beside) + (" and " in beside)]].append(case)
    return found


def hidden_in_measured(results: Results) -> str:
    """Effects that were hidden in measured records: grades by record and effect, names and strengths."""
    by_way = _by_references(results)
    return results.framed(MEASURED, _by_record(results), _by_effect(by_way), _rates_beside(by_way))


def _by_record(results: Results) -> str:
    """Grades by record and reference, and what the base model leaves of the record as it is."""
    records: dict[tuple[str, str], list[Graded]] = {}
    for cell, beside, case in in_measured(results):
        records.setdefault((cell, beside), []).append(case)
    lines = []
    for (cell, beside), cases in records.items():
        null = [f"{case.left_mv:.1f}" for case in cases if case.setting == "none" and case.left_mv is not None]
        grades = Counter(case.grade for case in cases)
        counts = [f"{count}" for count in (len(cases), *(grades[grade] for grade in ("right", "partial", "wrong")))]
        lines.append([cell, beside or _NONE, *counts, ", ".join(null) or _NONE])
    heads = ["record", "reference", "cases", "right", "partial", "wrong", "with nothing hidden, the model leaves / mV"]
    return markdown_table(heads, lines, 2)


def _by_effect(by_way: Mapping[str, Sequence[Graded]]) -> str:
    """How often what is hidden is answered rightly, by the effect where a single one is hidden."""
    ways = {
        way: _grouped(cases, lambda case: hidden_words(case) if case.setting == "single" else _SETTINGS[case.setting])
        for way, cases in by_way.items()
        if way != _ALONE
    }
    single = {name for found in ways.values() for name in found} - {*_SETTINGS.values()}
    names = [*sorted(single), *(words for setting, words in _SETTINGS.items() if setting != "single")]
    lines = [
        [name, *(_of([case.grade == "right" for case in found.get(name, ())]) for found in ways.values())]
        for name in names
    ]
    return markdown_table(["hidden", *(f"right, {way}" for way in ways)], lines)


def _rates_beside(by_way: Mapping[str, Sequence[Graded]]) -> str:
    lines = []
    for way, cases in by_way.items():
        covered = [case.covered == 1.0 for case in cases if case.covered is not None]
        errors = [case.parameter_error for case in cases if case.parameter_error is not None]
        parts = [f"a wrong name in {_share([case.grade == 'wrong' for case in cases])}"]
        if covered:
            parts.append(f"strengths inside their 95 % intervals in {_share(covered)}")
        if errors:
            near = sum(error <= 0.1 for error in errors)
            parts.append(f"within 10 % in {near} of {len(errors)}, largest error {max(errors):.0%}")
        seconds = float(np.median([case.cpu_s for case in cases]))
        lines.append(f"* {way}: {'; '.join(parts)}; median processor time {seconds:.0f} s.")
    return "\n".join(lines) + f"\n\n{_BRACKETS}."


def repeated_tests(results: Results) -> str:
    """How far tests of a cell are from those before them."""
    by_cell = grouped(results.rows("discovery_repeats"), "cell")
    tables = [f"{cell}:\n\n{repeats_table(rows)}" for cell, rows in by_cell.items()]
    return results.framed("discovery_repeats", "\n\n".join(tables))


def earlier_cases(results: Results) -> str:
    """Grades of the set whose effects and strengths were not drawn."""
    return results.framed(EARLIER, by_setting(graded(results)))


def graded(results: Results, studies: str = EARLIER) -> list[Graded]:
    """The cases of one or several files, in order."""
    rows = [row for study in studies.split() for row in results.rows(study)]
    return sorted((graded_of(row) for row in rows), key=lambda case: case.task)


def sensitivity(results: Results) -> str:
    """What half and twice each decision constant would change."""
    name = "discovery_sensitivity"
    return results.framed(name, sensitivity_table(results.rows(name)))


def time_taken(results: Results) -> str:
    """What one discovery costs, by the base model and the version."""
    columns = {
        "base model": "{model}",
        "version": "{version}",
        "machine code": "{compiled}",
        "processor s": "{processor_s:.0f}",
        "single-record solves": "{solves:.0f}",
        "contact resistance / mohm": "{strength_mohm:.1f}",
    }
    return results.framed("discovery_time", table_of(results.rows("discovery_time"), columns, 3))


def measured_cells(results: Results) -> str:
    """What discovery says of measured records."""
    columns: dict[str, Entry] = {
        "records": "{cell}",
        "verdict": "{verdict}",
        "named": lambda row: row["named"] or "none",
        "strength (95 %)": lambda row: (
            f"{brief(row['value'])} {row['unit']} ({brief(row['low'])} to {brief(row['high'])})" if row["unit"] else ""
        ),
        "fitted / mV": "{fitted_before_mv:brief} → {fitted_after_mv:brief}",
        "held out / mV": "{held_out_before_mv:brief} → {held_out_after_mv:brief}",
        "processor s": "{cpu_s:.0f}",
    }
    return results.framed("measured_cells", table_of(results.rows("measured_cells"), columns, 4))
