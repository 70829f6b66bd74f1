"""What may be installed, what was tested, and what tells both."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LEANT_ON = (
    "pybamm",
    "litellm",
    "openai",
    "ollama",
    "httpx",
    "httpcore",
    "pydantic",
    "pluggy",
    "transformers",
    "llguidance",
)


def requirements() -> dict[str, Requirement]:
    extras = PROJECT["optional-dependencies"]
    lines = [*PROJECT["dependencies"], *(line for name in extras for line in extras[name])]
    found = map(Requirement, lines)
    return {canonicalize_name(one.name): one for one in found if one.name != PROJECT["name"]}


def pins() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pairs = (line.split("==") for line in lines if not line.startswith("#"))
    return {canonicalize_name(name): version for name, version in pairs}


@pytest.mark.parametrize("version", ["1.82.7", "1.82.8"])
def test_releases_that_steal_credentials_are_excluded(version: str) -> None:
    allowed = requirements()["litellm"].specifier
    assert version not in allowed
    assert "1.82.6" in allowed
    assert "1.82.9" in allowed


@pytest.mark.parametrize("name", LEANT_ON)
def test_the_next_major_release_waits_for_a_test(name: str) -> None:
    major = int(pins()[name].partition(".")[0])
    assert f"{major + 1}.0" not in requirements()[name].specifier


@pytest.mark.parametrize("name", requirements())
def test_the_tested_set_pins_every_dependency_within_its_limits(name: str) -> None:
    assert pins()[name] in requirements()[name].specifier


def test_no_pin_names_a_build_or_a_place() -> None:
    assert all(re.fullmatch(r"[0-9][0-9a-z.]*", version) for version in pins().values())
    assert pins()["torch"] == "2.13.0"
    assert "battery-sim-agent" not in pins()


def imported() -> set[str]:
    """Libraries that the package imports anywhere, its own modules and Python's left out."""
    found: set[str] = set()
    for room in ("core", "plugins", "backends", "experiments", "testing"):
        for path in (ROOT / room).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Import):
                    found |= {alias.name.partition(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.level == 0:
                    found.add((node.module or "").partition(".")[0])
    return found - sys.stdlib_module_names


@pytest.mark.slow
def test_every_library_that_is_imported_is_a_dependency() -> None:
    distributions = packages_distributions()
    # The first is used where it is installed, and asked for by name; the second is jinja2's own type of a text.
    for library in imported() - {"bitsandbytes", "markupsafe"}:
        assert {canonicalize_name(name) for name in distributions.get(library, [library])} & set(requirements()), (
            library
        )


def test_the_citation_is_of_this_version_and_names_the_paper() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["cff-version"] == "1.2.0"
    assert (citation["version"], citation["license"]) == (PROJECT["version"], PROJECT["license"])
    paper = citation["preferred-citation"]
    assert f"https://doi.org/{paper['doi']}" in (ROOT / "README.md").read_text()
    names = " ".join(author["family-names"] for author in paper["authors"])
    assert names == "Chen Gui Fang Tao Zheng Liu Bian"


def test_the_changelog_has_this_version_below_what_is_to_come() -> None:
    headings = re.findall(r"(?m)^## \[([^\]]+)\]", (ROOT / "CHANGELOG.md").read_text())
    assert headings[0] == "Unreleased"
    assert PROJECT["version"] in headings
