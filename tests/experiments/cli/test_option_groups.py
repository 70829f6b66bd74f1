"""Options that commands share stand on each of them as if they were written there."""

from dataclasses import dataclass
from typing import Annotated

import pytest
import typer
from bsa.experiments.cli.option_groups import with_options
from bsa.experiments.cli.shared_options import Reading
from typer.testing import CliRunner


@dataclass(frozen=True)
class Colours:
    red: Annotated[int, typer.Option(min=0, help="How red.")] = 1
    blue: Annotated[bool, typer.Option("--blue", help="Whether blue.")] = False


def made(**defaults):
    app = typer.Typer()

    @app.command()
    @with_options(Colours, **defaults)
    def paint(wall: Annotated[str, typer.Argument()], *, colours: Colours, coats: int = 2) -> None:
        """Paint a wall."""
        print(wall, colours, coats)

    return app, paint


@pytest.mark.parametrize(
    ("typed", "shown"),
    [
        (["east"], "east Colours(red=1, blue=False) 2"),
        (["east", "--red", "7", "--blue", "--coats", "3"], "east Colours(red=7, blue=True) 3"),
    ],
)
def test_a_group_is_filled_from_the_command_line(typed, shown):
    result = CliRunner().invoke(made()[0], typed)
    assert (result.exit_code, result.output.strip()) == (0, shown)


def test_options_keep_their_limits_and_help():
    app, _ = made()
    assert CliRunner().invoke(app, ["east", "--red", "-1"]).exit_code == 2
    assert "How red." in CliRunner().invoke(app, ["--help"]).output


def test_a_command_may_have_a_default_of_its_own_and_is_called_as_a_function(capsys):
    made(red=4)[1](wall="west")
    assert capsys.readouterr().out.strip() == "west Colours(red=4, blue=False) 2"


def test_what_was_typed_of_a_record_is_told_by_its_options():
    assert Reading().typed == {}
    typed = Reading(constant_current=-2.0, current_sign="auto", where=["Step=010"]).typed
    assert typed == {"--where": ["Step=010"], "--current-sign": "auto", "--constant-current": -2.0}
