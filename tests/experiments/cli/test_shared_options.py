from typing import Annotated

import pytest
import typer
from bsa.experiments.cli.shared_options import note_what_resuming_leaves
from typer.testing import CliRunner


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (["--resume", "a", "--simulations", "24"], "--simulations is not taken"),
        (
            ["t.yaml", "--resume", "a", "--simulations", "10", "--workers", "2"],
            "argument TASK, --simulations are",
        ),
        (["--resume", "a", "--workers", "2"], ""),
    ],
)
def test_what_a_resumed_run_does_not_take_is_said(typed: list[str], words: str) -> None:
    app = typer.Typer()

    @app.command()
    def run(
        context: typer.Context,
        task: Annotated[str, typer.Argument()] = "",
        simulations: int = 10,
        workers: int = 0,
        resume: str = "",
    ) -> None:
        note_what_resuming_leaves(context, ("workers",))

    said = CliRunner().invoke(app, typed)
    assert said.exit_code == 0
    assert words in said.stderr
    assert bool(words) == ("note: a resumed run" in said.stderr)
