"""What the documentation says of hooks and commands is what the code has."""

import inspect
import re
from pathlib import Path

import pytest
from bsa.core.hooks import CatalogueHooks, RunHooks

ROOT = Path(__file__).parents[2]


def hooks(owner: type) -> list[tuple[str, str]]:
    found = []
    for name, function in inspect.getmembers(owner, inspect.isfunction):
        names = [parameter for parameter in inspect.signature(function).parameters if parameter != "self"]
        found.append((name, f"`{name}({', '.join(names)})`"))
    return found


@pytest.mark.parametrize(("name", "signature"), [*hooks(CatalogueHooks), *hooks(RunHooks)])
def test_every_hook_is_documented_with_its_signature(name: str, signature: str) -> None:
    assert signature in (ROOT / "docs" / "plugins.md").read_text()
    owner = CatalogueHooks if hasattr(CatalogueHooks, name) else RunHooks
    assert getattr(owner, name).__doc__


def test_the_ci_script_runs_the_readmes_test_command() -> None:
    readme = (ROOT / "README.md").read_text()
    commands = re.findall(r"```sh\n(.*?)```", readme, re.DOTALL)
    test_command = next(command for command in commands if "pytest" in command)
    script = (ROOT / ".ci" / "run").read_text()
    for part in re.findall(r"pip install ([^&\n]*)", test_command):
        assert part.strip() in script.replace("--quiet ", "")
    assert "python -m pytest" in script


PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub gives a page's headings."""
    prose = re.sub(r"(?ms)^```.*?^```", "", page.read_text())
    headings = [heading.lower() for heading in re.findall(r"(?m)^#+ (.+)$", prose)]
    return {re.sub(r"[^\w\- ]", "", heading).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_in_the_documentation_lead_to_a_file_and_a_heading(page: Path) -> None:
    for target in re.findall(r"\]\((?!https?:)([^)]+)\)", page.read_text()):
        file, _, anchor = target.partition("#")
        there = page.parent / file if file else page
        assert there.exists(), target
        assert not anchor or anchor in anchors(there), target


def test_the_scripts_that_contributors_are_told_of_are_there() -> None:
    scripts = set(re.findall(r"`(\.ci/[a-z]+)`", (ROOT / "CONTRIBUTING.md").read_text()))
    assert scripts == {f".ci/{path.name}" for path in (ROOT / ".ci").iterdir()}
    assert all((ROOT / script).stat().st_mode & 0o100 for script in scripts)
