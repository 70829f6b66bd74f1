"""Tables of discovery: the blind cases, who finds an effect without a fit, and measured cells."""

from bsa.experiments.campaign.text_tables import Entry, brief, table_of
from bsa.experiments.discovery_bench.grading import Graded, graded_of
from bsa.experiments.discovery_bench.repeats import Repeat, repeats_table
from bsa.experiments.discovery_bench.sensitivity import sensitivity_table
from bsa.experiments.discovery_bench.tables import as_markdown, case_table

from .results import Results

BLIND = "discovery_blind"
"""File of the cases that are drawn from the seed."""

MEASURED = "discovery_hidden"
"""File of the cases that are hidden in measured records."""

EARLIER = "discovery_cases discovery_earlier"
"""Files of the earlier set: cases run last, and those whose rows are an earlier version's."""


def blind_cases(results: Results) -> str:
    """Grades by setting, what was said of what, rates, gap, strengths and cost."""
    return results.framed(BLIND, as_markdown(graded(results, BLIND)).rstrip())


def each_blind_case(results: Results) -> str:
    """One line a case."""
    return case_table(graded(results, BLIND)).rstrip()


def in_measured(results: Results) -> list[tuple[str, str, Graded]]:
    """Cell, reference (empty without one) and grade of each case that is hidden in measured records."""
    rows = [(row.pop("cell"), row.pop("beside"), graded_of(row)) for row in results.rows(MEASURED)]
    return [(cell, beside if isinstance(beside, str) else "", case) for cell, beside, case in rows]


_WAYS = ("Without a reference", "Beside one reference", "Beside two references")
"""In words, how many references a case has."""


def hidden_in_measured(results: Results) -> str:
    """Effects that were hidden in measured records: grades, and one line a case."""
    told = in_measured(results)
    cases = [{"cell": cell, "beside": beside, **vars(case)} for cell, beside, case in told]
    columns: dict[str, Entry] = {
        "cell": "{cell}",
        "reference": lambda row: row["beside"] or "–",
        "case": "{task}",
        "hidden": lambda row: " + ".join(row["hidden"]) or "nothing",
        "strength": "{strength}",
        "verdict": "{verdict}",
        "named": lambda row: " + ".join(row["named"]),
        "grade": "{grade}",
        "base model leaves / mV": "{left_mv:.1f}",
        "the run had left / mV": lambda row: f"{row['known_mv']:.1f}" if row["known_mv"] else "",
        "error of the strength": lambda row: "" if row["parameter_error"] is None else f"{row['parameter_error']:.0%}",
        "processor s": "{cpu_s:.0f}",
    }
    counted = [(bool(beside) + (" and " in beside), case) for _, beside, case in told]
    parts = [(words, [case for number, case in counted if number == place]) for place, words in enumerate(_WAYS)]
    summary = "\n".join(f"{words}:\n\n{as_markdown(some)}" for words, some in parts)
    return results.framed(MEASURED, f"{summary}\n{table_of(cases, columns, 8)}")


def repeated_tests(results: Results) -> str:
    """How far tests of a cell are from those before them."""
    by_cell: dict[str, list[Repeat]] = {}
    for row in results.rows("discovery_repeats"):
        by_cell.setdefault(row.pop("cell"), []).append(Repeat(**row))
    tables = [f"{cell}:\n\n{repeats_table(rows)}" for cell, rows in by_cell.items()]
    return results.framed("discovery_repeats", "\n\n".join(tables))


def earlier_cases(results: Results) -> str:
    """The same of the set whose effects and strengths were not drawn."""
    return results.framed(EARLIER, as_markdown(graded(results)).rstrip())


def each_earlier_case(results: Results) -> str:
    """One line a case."""
    return case_table(graded(results)).rstrip()


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
