"""Verdicts on blind cases with half and twice each decision constant, on the fits that there are."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ...core.contracts.requests import Prediction, Simulator
from ...core.discovery.findings import Findings
from ...core.discovery.rules import RULES, Rules
from ...core.parameters import ParameterSpace
from ...core.run.journal import FILE_NAME
from ...core.run.recorded import RecordedSimulator
from ...core.task import CellModel
from ...plugins.pybamm.before_search.radial_mesh import RadialMesh
from ..campaign.text_tables import markdown_table
from ..discovery_case import read_case
from ..discovery_journal import opened, read_options
from ..discovery_setup import in_this_process, set_up
from .grading import grade_of
from .results import read_results

FACTORS = (0.5, 2.0)

NOT_SEARCHED = "not searched"
"""The base model was found to leave noise only, and with this constant effects would have been fitted."""

Row = Mapping[str, Any]


def sensitivity_rows(folder: Path, name: str) -> Iterator[dict[str, Any]]:
    """Every case of a campaign under every constant: as it is (factor 1), and changed.

    Fits are those of the journals: a constant that decides also what is fitted changes the verdict alone. The answers
    of the blind cases are opened.
    """
    for task, cell, result, answer in read_results(folder, name):
        if not result:
            continue
        found = _replayed(cell)
        for constant, factor, rules in _variants():
            verdict = verdict_by(rules, found)
            named = verdict["names"]
            yield {
                "task": task,
                "constant": constant,
                "factor": factor,
                "value": "" if not constant else getattr(rules, constant),
                "verdict": verdict["verdict"],
                "named": " + ".join(named),
                "grade": "" if verdict["verdict"] == NOT_SEARCHED else grade_of(verdict, answer),
            }


def _variants() -> Iterator[tuple[str, float, Rules]]:
    yield "", 1.0, RULES
    for constant in (field for field in fields(Rules) if isinstance(field.default, float)):
        for factor in FACTORS:
            yield constant.name, factor, replace(RULES, **{constant.name: factor * getattr(RULES, constant.name)})


def verdict_by(rules: Rules, found: Findings) -> dict[str, Any]:
    """The verdict that some rules give on what was fitted, its names and its rivals' names."""
    decided = rules.decide(found.gap, found.explanations)
    if found.verdict == "no-missing-effect" and decided.verdict != found.verdict:
        return {"verdict": NOT_SEARCHED, "names": (), "rivals": ()}
    named = decided.best.names if decided.verdict in ("effect-found", "ambiguous") else ()
    return {"verdict": decided.verdict, "names": named, "rivals": [rival.names for rival in decided.rivals]}


def _replayed(cell: Path) -> Findings:
    """What a discovery found, from a copy of its journal; what this version asks besides is simulated, and not kept."""
    with TemporaryDirectory() as place:
        shutil.copy(cell / FILE_NAME, place)
        options = read_options(Path(place))
        with opened(options) as journal:

            def make(model: CellModel, space: ParameterSpace, mesh: RadialMesh) -> Simulator:
                return RecordedSimulator(in_this_process(model, space, mesh), Prediction, journal.file, journal.earlier)

            return set_up(read_case(options), options, make_simulator=make, journal=journal).engine().run()


def sensitivity_table(rows: Sequence[Row]) -> str:
    """A line for each constant: what changes at half of it, and at twice."""
    known = {row["task"]: row for row in rows if row["factor"] == 1.0}
    lines = []
    # Of a constant that a later version has no more, the rows know what it was.
    values = {row["constant"]: row["value"] / row["factor"] for row in rows if row["factor"] != 1.0}
    for constant, value in values.items():
        lines.append(
            [f"`{constant}`", f"{value:.3g}", *(_changes(rows, known, constant, factor) for factor in FACTORS)]
        )
    return markdown_table(["constant", "value", f"half ({len(known)} cases)", "twice"], lines, 4)


def _changes(rows: Sequence[Row], known: Mapping[str, Row], constant: str, factor: float) -> str:
    """The verdicts that differ, in words."""
    found = []
    for row in rows:
        before = known[row["task"]]
        if row["constant"] == constant and row["factor"] == factor and _said(row) != _said(before):
            found.append(f"{row['task']}: {_said(before)} → {_said(row)}")
    return "; ".join(found) or "all the same"


def _said(row: Row) -> str:
    """Verdict, names and grade; a table that was read has no text where there was none."""
    named, grade = (row[key] if isinstance(row[key], str) else "" for key in ("named", "grade"))
    doubt = " (ambiguous)" * (row["verdict"] == "ambiguous")
    return f"{named or row['verdict']}{doubt}{', ' * bool(grade)}{grade}"
