"""Maccor text exports: columns with names of their own, and times in words."""

import re
from collections.abc import Container, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from ...core.printable import shown
from ...core.reading.samples import Samples
from ...core.record import ReadOptions
from .assembly import read_table
from .dates import clock_s
from .source import first_lines, load_text
from .table import Table, find_table

_HEAD_LINES = 40
_SUFFIX = re.compile(r"\.(txt|csv|\d{3})", re.IGNORECASE)

_UNIT = re.compile(r"\[\s*(?P<unit>.*?)\s*\]")

_STATES = ("state", "md")
_NAMES = {
    **dict.fromkeys(["testtime", "test time"], "Test Time / s"),
    **{f"test ({unit})": f"Test Time / {unit}" for unit in ("sec", "min", "hr")},
    **{f"test time ({unit})": f"Test Time / {unit}" for unit in ("sec", "min", "hr")},
    **dict.fromkeys(["amps", "current"], "Current / A"),
    **dict.fromkeys(["volts", "voltage"], "Voltage / V"),
    **dict.fromkeys(["cyc#", "cycle", "cycle c"], "Cycle Count / 1"),
    "step": "Step Index / 1",
    **dict.fromkeys(["dpt time", "dpt"], "Date Time"),
    **dict.fromkeys(["temp 1", "temp1", "temperature 1"], "Temperature T1 / degC"),
}
"""Maccor's names, as other readers know them."""


class MaccorText:
    """Reads ``Rec#``, ``Test (Sec)``, ``Amps``, ``Volts`` and ``State``, and times such as ``0d 01:10:00``."""

    def matches(self, path: Path) -> bool:
        """Whether a line near the top names a record number, a state, a current and a voltage."""
        if not _SUFFIX.fullmatch(path.suffix) or not path.is_file():
            return False
        return any(_is_header(re.split("[,\t]", line)) for line in first_lines(path, _HEAD_LINES))

    def read(self, path: Path, options: ReadOptions) -> Samples:
        """Read the file; see `Reader.read`."""
        text, notes = load_text(path)
        table = _translated(find_table(text, shown(path.name)), {*options.signal_columns.values(), *options.where})
        return read_table(table, options, notes)


def _is_header(names: Sequence[str]) -> bool:
    folded = {_plain(name) for name in names}
    signals = folded & {"amps", "current"} and folded & {"volts", "voltage"}
    return bool(signals) and bool(folded & set(_STATES)) and bool(folded & {"rec#", "rec"})


def _plain(name: str) -> str:
    """The name in small letters, without a unit in square brackets."""
    return re.sub(r"\s*\[.*?\]", "", name.strip().strip('"')).casefold()


def _translated(table: Table, kept: Container[str]) -> Table:
    """The table with the names and the times that other readers know; columns that the user names keep theirs."""
    times = [k for k, name in enumerate(table.header) if name not in kept and _is_time(name)]
    words = {k for k in times if clock_s(table.first(k)) is not None}
    header = tuple(name if name in kept else _name(name, k in words) for k, name in enumerate(table.header))

    def cells() -> Iterator[tuple[int, list[str]]]:
        for number, row in table.cells():
            for k in times:
                if k < len(row):
                    row[k] = _seconds(row[k])
            yield number, row

    return replace(table, header=header, cells=cells)


def _is_time(name: str) -> bool:
    return _NAMES.get(_plain(name), "").startswith("Test Time")


def _name(original: str, in_words: bool) -> str:
    """The name that other readers know, with the unit of the original; a time in words is given in seconds."""
    known = _NAMES.get(_plain(original))
    if known is None:
        return shown(original)
    bracketed = _UNIT.search(original)
    if in_words or bracketed is None or not bracketed["unit"]:
        return "Test Time / s" if in_words else known
    return f"{known.split(' / ')[0]} / {bracketed['unit']}"


def _seconds(text: str) -> str:
    seconds = clock_s(text)
    return text if seconds is None else repr(seconds)
