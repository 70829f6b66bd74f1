"""Every command of the documentation is one: its options are those that the command line has."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer
from bsa.experiments.cli.main import app
from bsa.experiments.cli.run import run
from bsa.experiments.cli.several_files import RecordsCommand

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
ACT_AT_ONCE = {"--install-completion", "--show-completion", "--version", "--help", "-h"}
"""Options that act as soon as they are read."""

CALL = re.compile(r"(?:^|\s|/)(bsa(?:-run)?) (.*)")


def bsa_run() -> Any:
    alone = typer.Typer()
    alone.command(cls=RecordsCommand)(run)
    return typer.main.get_command(alone)


COMMANDS = {"bsa": typer.main.get_command(app()), "bsa-run": bsa_run()}


def examples(page: Path) -> list[str]:
    """The lines of a page's shell examples that call a command."""
    blocks = "".join(re.findall(r"(?ms)^```(?:sh|console)\n(.*?)^```", page.read_text(encoding="utf-8")))
    return [line for line in blocks.replace("\\\n", " ").splitlines() if CALL.search(line)]


def mentions(page: Path) -> list[str]:
    """The commands that a page's text names, whole or in part."""
    prose = re.sub(r"(?ms)^```.*?^```", "", page.read_text(encoding="utf-8"))
    return [line.replace("\\|", "|") for line in re.findall(r"`(bsa(?:-run)? [^`]+)`", prose)]


def calls(line: str) -> list[tuple[Any, typer.Context, list[str]]]:
    """The command of each call in a line, its parent's context and the words that are left for it."""
    found = []
    for call in filter(None, map(CALL.search, re.split(r"&&|\|\||;|\|", line.partition(" #")[0]))):
        command, words, parent = COMMANDS[call[1]], [word for word in shlex.split(call[2]) if word != "..."], None
        while hasattr(command, "commands") and words and not words[0].startswith("-"):
            context = typer.Context(command, info_name=command.name, parent=parent)
            _, command, words = command.resolve_command(context, words)
            parent = context
        found.append((command, parent, words))
    return found


@pytest.mark.parametrize(("page", "line"), [(page.name, line) for page in PAGES for line in examples(page)])
def test_an_example_can_be_given(page: str, line: str) -> None:
    for command, parent, words in calls(line):
        assert not set(words) & ACT_AT_ONCE
        command.make_context(command.name or "bsa-run", words, parent=parent)


@pytest.mark.parametrize(("page", "line"), [(page.name, line) for page in PAGES for line in mentions(page)])
def test_what_the_text_names_is_there(page: str, line: str) -> None:
    for command, parent, words in calls(line):
        context = typer.Context(command, parent=parent)
        known = {option for one in command.get_params(context) for option in (*one.opts, *one.secondary_opts)}
        assert {word.partition("=")[0] for word in words if word.startswith("--")} <= known
        if hasattr(command, "commands") or ACT_AT_ONCE & set(words):
            assert all(word.startswith("-") for word in words)
            continue
        try:
            command.make_context(command.name or "bsa-run", words, parent=parent)
        except Exception as error:  # an option that is only named, or a command without its argument
            if not re.search(r"has no value|is missing|requires an argument|Missing", str(error)):
                raise


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("bsa runn", "No such command 'runn'"),
        ("bsa run --simulatons 5", "has no option --simulatons"),
        ("bsa-run --rounds many", "a whole number was expected"),
        ("bsa grid", "Missing parameter"),
    ],
)
def test_what_is_no_command_is_noticed(line: str, words: str) -> None:
    with pytest.raises(Exception, match=words):
        test_an_example_can_be_given("", line)


def test_the_pages_have_commands() -> None:
    assert len(mentions(ROOT / "README.md")) > 10
    assert sum(len(examples(page)) for page in PAGES) > 10
