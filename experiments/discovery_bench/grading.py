"""Opens the answers and grades what was said: names right and wrong, gap closed, strengths and intervals, cost."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .results import read_results

Result = Mapping[str, Any]
"""What was found of a case, or its answer."""

CLEAR_EVIDENCE = math.log(20.0)
"""Log odds of the true model over the base fit from which an effect counts as detectable: 20 to 1."""

_SURFACES = {
    "double-layer-capacitance": ("Negative", "Positive"),
    "sei-growth": ("Negative",),
    "lithium-plating": ("Negative",),
}
"""Effects whose strength acts on each square metre of particle surface, and in which electrodes. A discovery fits no
radius: a smaller one, which has more surface, is a larger strength to it."""


_MAYBE = ("parameter_error", "evidence", "covered", "left_mv", "known_mv")
"""Numbers of a case that may be unknown."""


@dataclass(frozen=True)
class Graded:
    """One case with its grade."""

    # task, setting: Which case, and what it was for.
    task: str
    setting: str
    hidden: tuple[str, ...]  # Names of what was hidden; an effect of no catalogue in brackets.
    verdict: str  # The discovery's verdict.
    named: tuple[str, ...]  # What it named.
    # ``ambiguous``: declared, with the hidden effect among those named; ``declined``: no name where there was
    # something (no discrepancy seen, or unexplained); ``partial``: some of a pair.
    grade: str
    # closed, held_closed: Share of the gap closed on fitted and on held-out data; NaN where there was no gap.
    closed: float
    held_closed: float
    parameter_error: float | None  # Relative error of the strength, where the name is right.
    # wall_s, cpu_s: Wall time and processor time of the case's process, s.
    wall_s: float
    cpu_s: float
    simulations: float  # Single-record solves.
    model: str = ""  # Base model.
    # Log odds of the true model at its true parameters over the base fit (BIC); None where nothing can be named.
    evidence: float | None = None
    covered: float | None = None  # Share of the strengths inside their 95 % intervals, where the name is right.
    strength: str = ""  # How strong what is hidden is, with its unit.
    left_mv: float | None = None  # What the base model leaves of the fitted records, root mean square, mV.
    known_mv: float | None = None  # What it left of the records of the run that it comes from, mV.

    @property
    def detectable(self) -> bool:
        """Whether the records tell the true model from the base fit."""
        return self.evidence is not None and self.evidence > CLEAR_EVIDENCE


def grade_cases(folder: Path, name: str) -> list[Graded]:
    """Grade every case that a campaign has run."""
    told = sorted(read_results(folder, name), key=lambda case: case[0])
    return [_graded(task, {**_FAILED, **found}, answer) for task, _, found, answer in told]


_FAILED = {"verdict": "failed", "names": (), "wall_s": 0.0, "cpu_s": 0.0, "simulations": 0}


def _graded(task: str, found: Result, answer: Result) -> Graded:
    hidden = _hidden(answer)
    grade = grade_of(found, answer)
    gap = found.get("gap", {})
    strengths = list(_strengths(found, answer)) if grade == "right" and found["names"] else []
    return Graded(
        task,
        answer["setting"],
        hidden,
        found["verdict"],
        tuple(found["names"]),
        grade,
        _share(gap, "closed"),
        _share(gap, "holdout_closed"),
        max((abs(value - true) / abs(true - null) for true, null, value, _ in strengths if true != null), default=None),
        found["wall_s"],
        found["cpu_s"],
        found["simulations"],
        answer["model"],
        _evidence(found, answer),
        sum(low <= true <= high for true, _, _, (low, high) in strengths) / len(strengths) if strengths else None,
        _strength(answer),
        gap.get("base_rmse_mv"),
        gap.get("known_mv"),
    )


def _strength(answer: Result) -> str:
    """How strong what is hidden is: ``"0.0123 Ohm"``."""
    if answer["outside"]:
        return f"{answer.get('outside_strength', math.nan):.3g} V"
    units = [(name.partition("[")[2].rstrip("]"), value) for name, value in answer["strengths"].values()]
    return ", ".join(f"{value:.3g} {unit}".rstrip() for unit, value in units)


def _share(gap: Mapping[str, float | None], name: str) -> float:
    value = gap.get(name)
    return math.nan if value is None else value


def _hidden(answer: Result) -> tuple[str, ...]:
    return tuple(sorted(set(answer["names"]))) or ((f"[{answer['outside']}]",) if answer["outside"] else ())


def grade_of(row: Result, answer: Result) -> str:
    """The grade of a verdict with its names and rivals; see `Graded`."""
    verdict, named, hidden = row["verdict"], tuple(row["names"]), _hidden(answer)
    if verdict == "failed":
        return "failed"
    if not hidden and answer.get("measured"):
        # What a measured cell lacks of its own nobody knows, and no name can be checked.
        return "right" if verdict in ("no-missing-effect", "unexplained") else "wrong"
    if not hidden:
        return "right" if verdict == "no-missing-effect" else "declined" if verdict == "unexplained" else "wrong"
    if answer["outside"]:
        return "right" if verdict == "unexplained" else "declined" if verdict == "no-missing-effect" else "wrong"
    if verdict in ("unexplained", "no-missing-effect"):
        return "declined"
    if verdict == "ambiguous":
        return "ambiguous" if {hidden} & {named, *(tuple(rival) for rival in row.get("rivals", []))} else "wrong"
    return "right" if named == hidden else "partial" if set(named) < set(hidden) else "wrong"


def _evidence(row: Result, answer: Result) -> float | None:
    """Half the difference of BIC between the base fit and the truth, which has the hidden strengths besides."""
    if not answer["keys"] or answer["truth_chi2"] is None or row.get("base_chi2") is None:
        return None
    return 0.5 * float(
        row["base_chi2"] - answer["truth_chi2"] - len(answer["keys"]) * math.log(max(answer["averages"], 1))
    )


def _strengths(row: Result, answer: Result) -> list[tuple[float, float, float, tuple[float, float]]]:
    """Truth, null value, fitted value and interval of each hidden strength, where the variant is right, too.

    The truth is the strength at the set's own radii, see `_SURFACES`; where there is no single one, it is left out.
    """
    found = []
    true = dict(answer["strengths"].values())
    for effect in row["effects"]:
        parameter = effect["parameters"][0]
        unit = f" [{parameter['unit']}]" if parameter["unit"] else ""
        name = f"{effect['name']}: {parameter['name']}{unit}"
        variant = f" ({effect['variant']})" if effect.get("variant") else ""
        electrodes = _SURFACES.get(effect["name"], ())
        radii = {answer["shifts"].get(f"{which} particle radius [m]", 1.0) for which in electrodes} or {1.0}
        if len(radii) == 1 and name in true and f"{effect['name']}{variant}" in answer["strengths"]:
            low, high = parameter["ci95"]
            found.append((true[name] / radii.pop(), parameter["null"], parameter["value"], (low, high)))
    return found


def graded_row(graded: Graded) -> dict[str, Any]:
    """A case as a flat row, for CSV."""
    return {**asdict(graded), "hidden": " + ".join(graded.hidden), "named": " + ".join(graded.named)}


def graded_of(row: Mapping[str, Any]) -> Graded:
    """The case of a row that `graded_row` made and `read_table` read."""
    texts = {name: tuple(row[name].split(" + ")) if isinstance(row[name], str) else () for name in ("hidden", "named")}
    known = {name: row.get(name, math.nan) for name in _MAYBE}
    numbers = {name: None if value is None or math.isnan(value) else float(value) for name, value in known.items()}
    # A gain has no unit, and is read as a number.
    words = {name: "" if (word := str(row.get(name, ""))) == "nan" else word for name in ("model", "strength")}
    return Graded(**{**row, **texts, **numbers, **words})
