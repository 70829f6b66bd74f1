"""The sections of a prompt: their headings, and how one is written and read."""

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal
from typing import Any

TASK = "Task"
PRIORS = "Priors"
FEEDBACK = "Feedback"
CYCLES = "Cycles that matter most"
LAST_ATTEMPT = "Last attempt, no better"
NUMERICS = "Numerics"
DIGEST = "Digest"
INSTRUCTION = "What to do"

MEMORY = "Memory"
"""Sections whose heading begins with this may be left out of a prompt that is too long."""

TRIALS = f"{MEMORY}: trials so far"
SENSITIVITIES = f"{MEMORY}: learnt sensitivities"

TRIAL_FEATURES = "features_in_the_order_of_the_feedback"
"""Where a section tells the features of a trial whose names stand in the feedback."""

ALIKE = "move_the_features_alike"
"""Where the learnt sensitivities tell groups of parameters with the same effects."""

RECORD = "the_record"
"""Where the numerics tell which parameters the measured record does not fix."""

_SMALL = 1e-3
"""Numbers below this are written with a power of ten."""

_LARGEST_WHOLE = 1e15
"""Whole numbers below this are exact and written without a point."""

_SECTION = re.compile(r"^## (?P<heading>[^\n]+)\n```json\n(?P<body>.*?)\n```", re.DOTALL | re.MULTILINE)
_START = re.compile(r"(?m)^(?=## )")


def section(heading: str, content: Mapping[str, Any]) -> str:
    """A heading and a fenced JSON block: one key a line, one row of a table a line, no needless characters."""
    if not isinstance(content, Mapping):
        return f"{title(heading)}```json\n{_written(content)}\n```"
    lines = ",\n".join(f"{_written(str(key))}: {_written(value)}" for key, value in content.items())
    return f"{title(heading)}```json\n{{{lines}}}\n```"


def table(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> dict[str, Any]:
    """Rows under the names of their columns, which stand in a prompt once."""
    return {"columns": list(columns), "rows": [list(row) for row in rows]}


def numbered(value: Any, names: Sequence[str]) -> Any:
    """A copy in which each of these names is its number in their order, which is from 1 on."""
    if isinstance(value, str):
        return names.index(value) + 1 if value in names else value
    if isinstance(value, Mapping):
        return {key: numbered(item, names) for key, item in value.items()}
    return [numbered(item, names) for item in value] if isinstance(value, (list, tuple)) else value


def named(entry: object, names: Sequence[str]) -> str:
    """The name behind a number that `numbered` wrote; what is no such number, as text."""
    whole = isinstance(entry, int) and not isinstance(entry, bool)
    return names[entry - 1] if whole and 1 <= entry <= len(names) else str(entry)  # type: ignore[operator]


def read_table(content: object) -> tuple[list[str], list[list[Any]]]:
    """The columns and rows of a table; a row of another length, and what has no such form, is left out."""
    if not isinstance(content, Mapping):
        return [], []
    columns, rows = content.get("columns"), content.get("rows")
    if not (isinstance(columns, list) and all(isinstance(name, str) for name in columns) and isinstance(rows, list)):
        return [], []
    return columns, [row for row in rows if isinstance(row, list) and len(row) == len(columns)]


def _written(value: Any) -> str:
    """JSON without spaces; tables by line, and numbers as short as they are exact."""
    if isinstance(value, Mapping):
        is_table = value.keys() == {"columns", "rows"} and isinstance(value["rows"], list) and bool(value["rows"])
        parts = (f"{json.dumps(str(key), ensure_ascii=False)}:{_written(item)}" for key, item in value.items())
        if is_table:
            rows = ",\n".join(map(_written, value["rows"]))
            return f'{{"columns":{_written(value["columns"])},"rows":[\n{rows}]}}'
        return f"{{{','.join(parts)}}}"
    if isinstance(value, (list, tuple)):
        return f"[{','.join(map(_written, value))}]"
    if isinstance(value, float) and math.isfinite(value):
        return _number(value)
    return json.dumps(value, ensure_ascii=False)


def _number(value: float) -> str:
    """A float that reads back as itself; small ones in powers of a thousand, so that all lengths have one unit."""
    if value.is_integer() and abs(value) < _LARGEST_WHOLE:
        return str(int(value))
    if abs(value) >= _SMALL:
        return repr(value)
    power = 3 * math.floor(math.log10(abs(value)) / 3)
    mantissa = Decimal(repr(value)).scaleb(-power)
    return f"{mantissa:f}e{power}"


def title(heading: str) -> str:
    """The line of a heading."""
    return f"## {heading}\n"


def read_sections(text: str) -> list[tuple[str, Any]]:
    """Heading and JSON content of every section in order; what is no JSON is left out."""
    found: list[tuple[str, Any]] = []
    for match in _SECTION.finditer(text):
        try:
            found.append((match["heading"], json.loads(match["body"])))
        except (ValueError, RecursionError):
            continue
    return found


def without_first_memory(text: str) -> tuple[str, str] | None:
    """The text without its first section headed `MEMORY`, and that section's heading; None if it has none."""
    sections = _START.split(text)
    for index, part in enumerate(sections):
        heading = part.partition("\n")[0].removeprefix("## ")
        if part.startswith("## ") and heading.startswith(MEMORY):
            return "".join(sections[:index] + sections[index + 1 :]), heading
    return None
