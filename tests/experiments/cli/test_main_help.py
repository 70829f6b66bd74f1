"""The help pages on a narrow terminal: grouped, and no word or option broken."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
import typer
from bsa.experiments.cli.completion import search_presets
from bsa.experiments.cli.main import app
from typer.testing import CliRunner

GROUPS = ["Records", "Model", "Search", "Language model", "Output"]


def commands(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command below a group, with its words."""
    for name, inner in getattr(command, "commands", {}).items():
        yield from commands(inner, (*path, name))
    if not hasattr(command, "commands"):
        yield path, command


COMMANDS = {
    " ".join(path): command
    for path, command in commands(typer.main.get_command(app()))
    if path[0] in ("run", "data", "discover", "grid", "bench", "report")
}


def page(words: str) -> list[str]:
    """The lines of a help page, without frames."""
    result = CliRunner().invoke(app(), [*words.split(), "--help"], env={"COLUMNS": "80", "TERMINAL_WIDTH": "80"})
    assert result.exit_code == 0
    assert all(len(line) <= 80 for line in result.stdout.splitlines())
    return [line.strip("│ ") for line in result.stdout.splitlines()]


@pytest.mark.parametrize("words", COMMANDS)
def test_options_stand_in_their_groups_and_no_word_is_broken(words: str) -> None:
    lines = page(words)
    shown = set(" ".join(lines).split())
    for parameter in COMMANDS[words].params:
        if parameter.name in ("help", "version", "install_completion", "show_completion"):
            continue
        assert set((parameter.help or "").split()) <= shown
        if parameter.param_type_name == "option":
            assert parameter.rich_help_panel in GROUPS, parameter.name
            assert {option.strip() for option in (*parameter.opts, *parameter.secondary_opts)} - {""} <= shown
    titles = [found.group(1) for line in lines if (found := re.match(r"╭─ ([A-Z][a-z ]+) ─", line))]
    assert [title for title in titles if title in GROUPS] == [group for group in GROUPS if group in titles]
    assert "…" not in "".join(lines)


def test_the_help_of_a_run_names_every_preset_and_the_nearest_set() -> None:
    helps = {parameter.name: parameter.help for parameter in COMMANDS["run"].params}
    assert set(search_presets()) <= set(re.findall(r"[\w-]+", helps["search"]))
    assert "nearest" in helps["parameters"]


def test_the_blind_cases_have_a_command_for_each_step() -> None:
    assert {name for name in COMMANDS if name.startswith("bench discovery")} == {
        f"bench discovery {step}" for step in ("make", "hide", "repeats", "run", "score", "sensitivity", "shortlist")
    }
