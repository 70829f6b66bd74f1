"""Tests mirror the package: who changes a module finds its tests, and who reads a test finds what it is about."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ELSEWHERE = {
    "packaging": "the distribution as a whole: its structure, dependencies, contents and documentation",
    "third_party_plugin": "a package of its own, with its own tests",
    "oscillator_plugin": "a package of its own, with its own tests",
}
"""Folders of tests that belong to no module, each with its reason."""

TESTS = [path.relative_to(ROOT / "tests") for path in sorted((ROOT / "tests").rglob("test_*.py"))]


def subjects(folder: Path) -> set[str]:
    """The modules and sub-packages of the folder that a folder of tests mirrors, and that folder itself."""
    modules = {path.stem for path in (ROOT / folder).glob("*.py")} - {"__init__"}
    packages = {path.parent.name for path in (ROOT / folder).glob("*/__init__.py")}
    return modules | packages | {folder.name}


@pytest.mark.parametrize("test", [test for test in TESTS if test.parts[0] not in ELSEWHERE], ids=str)
def test_every_test_is_named_for_what_it_tests(test: Path) -> None:
    about = test.stem.removeprefix("test_")
    folder = test.parent
    assert (ROOT / folder / "__init__.py").is_file(), f"there is no package {folder}: move tests/{test}"
    assert any(about == name or about.startswith(f"{name}_") for name in subjects(folder)), (
        f"tests/{test} is named for no module of {folder}/: call it test_MODULE.py, or test_MODULE_ASPECT.py"
    )


def test_the_exceptions_are_there() -> None:
    assert {test.parts[0] for test in TESTS} > set(ELSEWHERE)
