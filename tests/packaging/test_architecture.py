"""Three floors, and imports never point up."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("core", "plugins", "backends", "scaffolds", "experiments", "testing")
MAY_IMPORT = {
    "core": {"core"},
    "plugins": {"core", "plugins"},
    "backends": {"core", "backends"},
    "scaffolds": set(),
    "experiments": {"core", "plugins", "backends", "experiments"},
    "testing": {"core", "backends", "experiments", "testing"},
}
ROOMS_OF_CORE = ("words", "contracts", "reading", "inference", "run", "discovery")
"""A room of core imports from those before it; the words are the modules of core itself, which plugins import."""

WORDS = {"ageing", "comparison", "segmentation"}
"""Rooms that stand with the words: a trajectory may be a record of cycles, a trial has residuals."""

OF_A_LATER_ROOM = {("core/record.py", "reading")}
"""A reader's answer is a `reading.samples.Samples`, which is named for type checkers alone."""

FORBIDDEN_IN_CORE = {"pybamm", "torch", "litellm", "ollama", "transformers", "matplotlib", "typer", "rich", "pandas"}


def modules() -> list[Path]:
    return sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))


def imports(path: Path) -> list[tuple[int, str]]:
    """Level and dotted name of every import of a module."""
    found: list[tuple[int, str]] = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            found.append((node.level, node.module or ""))
        elif isinstance(node, ast.Import):
            found += [(0, alias.name) for alias in node.names]
    return found


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_never_point_up(path: Path) -> None:
    parts = path.relative_to(ROOT).parts
    for level, name in imports(path):
        if level == 0:
            assert name.split(".")[0] != "bsa", f"{path} imports {name} absolutely"
            if parts[0] == "core":
                assert name.split(".")[0] not in FORBIDDEN_IN_CORE
        elif level == len(parts):
            assert name.split(".")[0] in MAY_IMPORT[parts[0]], f"{path} imports from {name}"


def room_of_core(parts: tuple[str, ...]) -> str:
    """The room of a module of core, from its path below core."""
    return "words" if len(parts) == 1 or parts[0] in WORDS else parts[0]


@pytest.mark.parametrize(
    "path", sorted((ROOT / "core").rglob("*.py")), ids=lambda path: str(path.relative_to(ROOT / "core"))
)
def test_rooms_of_core_never_import_from_a_later_one(path: Path) -> None:
    parts = path.relative_to(ROOT / "core").parts
    for level, name in imports(path):
        if level != len(parts):
            continue
        first = name.split(".")[0]
        target = first if first in ROOMS_OF_CORE else "words"
        if (str(path.relative_to(ROOT)), target) not in OF_A_LATER_ROOM:
            assert ROOMS_OF_CORE.index(target) <= ROOMS_OF_CORE.index(room_of_core(parts)), f"imports from {name}"


def test_every_room_of_core_has_its_place() -> None:
    rooms = {path.parent.name for path in (ROOT / "core").glob("*/__init__.py")}
    assert rooms == {*ROOMS_OF_CORE, *WORDS} - {"words"}


def test_no_module_is_a_junk_drawer() -> None:
    names = {path.stem for path in modules()}
    assert not names & {"utils", "util", "helpers", "helper", "misc", "common", "base"}


def test_nothing_is_left_unfinished() -> None:
    unfinished = re.compile(r"\b(TODO|FIXME|XXX)\b|raise NotImplementedError")
    assert [str(path) for path in modules() if unfinished.search(path.read_text())] == []
