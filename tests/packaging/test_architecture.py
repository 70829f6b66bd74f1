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
ROOMS_IN_ORDER = {
    "core": ("words", "contracts", "reading", "inference", "run", "discovery"),
    "plugins/pybamm": ("words", "cells", "modelling", "solving", "before_search", "export", "simulators"),
}
"""A room imports from those before it; the words are the modules in no room, which other packages import."""

WITH_THE_WORDS = {"core": {"ageing", "comparison", "segmentation"}, "plugins/pybamm": set[str]()}
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


@pytest.mark.slow
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


def modules_in_rooms() -> list[tuple[str, Path]]:
    """Each package that has rooms, with each of its modules."""
    return [(package, path) for package in ROOMS_IN_ORDER for path in sorted((ROOT / package).rglob("*.py"))]


@pytest.mark.parametrize(
    ("package", "path"), modules_in_rooms(), ids=[str(path.relative_to(ROOT)) for _, path in modules_in_rooms()]
)
def test_rooms_never_import_from_a_later_one(package: str, path: Path) -> None:
    rooms = ROOMS_IN_ORDER[package]
    parts = path.relative_to(ROOT / package).parts
    own = rooms.index(parts[0]) if parts[0] in rooms else 0
    for level, name in imports(path):
        if level != len(parts):
            continue
        first = name.split(".")[0]
        target = first if first in rooms else "words"
        if (str(path.relative_to(ROOT)), target) not in OF_A_LATER_ROOM:
            assert rooms.index(target) <= own, f"imports from {name}"


@pytest.mark.parametrize("package", ROOMS_IN_ORDER)
def test_every_room_has_its_place(package: str) -> None:
    rooms = {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
    assert rooms == {*ROOMS_IN_ORDER[package], *WITH_THE_WORDS[package]} - {"words"}


def test_no_module_is_a_junk_drawer() -> None:
    names = {path.stem for path in modules()}
    assert not names & {"utils", "util", "helpers", "helper", "misc", "common", "base"}


def test_nothing_is_left_unfinished() -> None:
    unfinished = re.compile(r"\b(TODO|FIXME|XXX)\b|raise NotImplementedError")
    assert [str(path) for path in modules() if unfinished.search(path.read_text())] == []
