"""Every table of the documentation, made again from its rows."""

import re
from pathlib import Path

from bsa.core.errors import BsaError, unknown
from bsa.core.files import write_text

from .catalogue import TABLES
from .results import Results

RESULTS = Path("docs") / "results"

_MARKER = re.compile(r"<!-- (table: (?P<name>[^\n]*?)|end of table) -->")


def documents(root: Path) -> list[Path]:
    """The documents whose tables are rebuilt."""
    return [root / "README.md", *sorted((root / "docs").glob("*.md"))]


def rebuild(root: Path, write: bool = True) -> list[Path]:
    """Make every table of the documentation again.

    Gives the documents that differed, which are written if ``write``. Raises `BsaError` if there is no documentation, a
    marker is not closed or names no table, or rows are missing.
    """
    if not (root / RESULTS).is_dir():
        raise BsaError(f"{root / RESULTS} is missing.", "give the folder of a checkout of this package.")
    changed = []
    for path in documents(root):
        link = RESULTS.as_posix() if path.parent == root else RESULTS.name
        text = path.read_text(encoding="utf-8")
        rebuilt = with_tables(text, Results(root / RESULTS, link), path)
        if rebuilt != text:
            changed.append(path)
            if write:
                write_text(path, rebuilt)
    return changed


def with_tables(text: str, results: Results, path: Path) -> str:
    """A document with what stands between ``<!-- table: NAME -->`` and ``<!-- end of table -->`` made from rows."""
    parts, after = [], 0
    markers = list(_MARKER.finditer(text))
    for place, marker in enumerate(markers):
        name = marker["name"]
        opens_next = place + 1 < len(markers) and markers[place + 1]["name"] is None
        if (name is None) == (place % 2 == 0) or (name is not None and not opens_next):
            line = text.count("\n", 0, marker.start()) + 1
            raise BsaError(
                f"{path}:{line}: markers of tables do not pair.", "each table: ends with <!-- end of table -->."
            )
        if name is None:
            continue
        if name not in TABLES:
            raise unknown(f'{path}: there is no table "{name}".', name, TABLES)
        parts += [text[after : marker.end()], f"\n{TABLES[name](results)}\n"]
        after = markers[place + 1].start()
    return "".join([*parts, text[after:]])
