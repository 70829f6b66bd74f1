"""bsa grid, bsa report and bsa bench tables, as a person calls them."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer
import yaml
from bsa.core.encoding import encode_task
from bsa.core.errors import BsaError
from bsa.experiments.campaign import running
from bsa.experiments.campaign.store import Store
from bsa.experiments.cli.campaign import finish, print_outcome
from bsa.experiments.cli.exit_codes import INTERRUPTED
from bsa.experiments.cli.main import app
from bsa_toy_cell import toy_task
from typer.testing import CliRunner, Result


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Calls the command in a folder with a small grid."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "toy.json").write_text(json.dumps(encode_task(toy_task())))
    content = {
        "name": "toys",
        "tasks": ["toy.json"],
        "scaffolds": ["full", "no-memory"],
        "rounds": 1,
        "warm_up": 1,
        "simulations": 3,
        "settings": {"simulator.use": "toy-cell"},
    }
    (tmp_path / "toys.yaml").write_text(yaml.safe_dump(content))

    def run(*arguments: str, code: int = 0) -> Result:
        result = CliRunner().invoke(app(), arguments)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        assert result.exit_code == code, result.output
        return result

    return run


def test_dry_run_runs_nothing(call):
    shown = call("grid", "toys.yaml", "--dry-run", "--workers", "2", "--set", "seeds=[1,2,3]").output
    assert "toys: 6 runs, 0 of them finished" in shown
    assert "18 simulations at most; about " in shown
    assert "with 2 workers" in shown
    assert not Path("results/cells").exists()


def test_the_command_that_writes_the_page_can_be_pasted(tmp_path, capsys):
    store = Store(tmp_path / "my results")
    print_outcome(SimpleNamespace(name="a b", folder=store.grid("a b"), store=store), [])
    (line,) = (line for line in capsys.readouterr().out.splitlines() if line.endswith(" writes the page."))
    command = shlex.split(line.removesuffix(" writes the page."))
    assert command == ["bsa", "report", "a b", "--store", str(tmp_path / "my results")]


def test_the_words_of_a_server_do_not_steer_the_terminal(capsys):
    with pytest.raises(typer.Exit):
        finish(
            [{"state": "failed", "task": "t", "identity": "1a", "reason": "server says \x1b]0;owned\x07\x1b[2Jhello"}]
        )
    told = capsys.readouterr().err
    assert "hello. The same command runs it again." in told
    assert all(character.isprintable() for character in told.strip())


@pytest.mark.parametrize("word", ["x", "tcp", "tcp://", "tcp://host", "http://host:1", "slurm", "dask://host:1"])
@pytest.mark.parametrize("more", [(), ("--dry-run",)])
def test_a_word_that_is_no_cluster_is_refused_before_tasks_are_made(call, word, more):
    with pytest.raises(BsaError, match="is no cluster"):
        call("grid", "toys.yaml", "--cluster", word, *more)
    with pytest.raises(BsaError, match=r"gone\.yaml does not exist"):
        call("grid", "toys.yaml", "--cluster", "slurm:gone.yaml", *more)
    assert not Path("results").exists()


@pytest.mark.slow
def test_run_report_and_tables(call):
    shown = call("grid", "toys.yaml", "--workers", "1")
    assert "2 of 2 cells done (0 were already), 0 failed" in shown.stderr
    assert "full" in shown.stdout
    again = call("grid", "toys.yaml", "--workers", "1").stderr
    assert "2 of 2 cells done (2 were already), 0 failed" in again
    assert Path(call("report", "toys").stdout.strip()).is_file()
    assert Path(call("report", "toys.yaml", "--out", "page/toys.html").stdout.strip()).is_file()
    written = call("bench", "tables", "toys", "--out", "tables").stdout
    assert "tables/tables.tex" in written
    (cell, _) = Path("results/cells").iterdir()
    assert call("report", str(cell)).stdout.strip().endswith("report.html")
    with pytest.raises(BsaError, match=r"--full, --metric go with a grid, but .* is the folder of a run"):
        call("report", str(cell), "--full", "--metric", "nonsense")
    with pytest.raises(BsaError, match=r"--store goes with a grid"):
        call("report", str(cell), "--store", "elsewhere")


@pytest.mark.slow
def test_what_fails_is_said_and_ends_in_an_error(call):
    shown = call("grid", "toys.yaml", "--workers", "1", "--set", "backends=[rules, 'openai:nothing']", code=1)
    assert "2 failed" in shown.stderr
    assert "The same command runs them again." in shown.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("grid", "toy.yaml"), "does not exist"),
        (("grid", "rules-ablatoin"), "rules-ablation"),
        (("grid", "toys.yaml", "--set", "rounds"), "key=value"),
        (("grid", "toys.yaml", "--set", "rounds=many"), "rounds"),
        (("grid", "toys.yaml", "--cluster", "here"), "tcp://"),
        (("report", "toys"), "has not been run"),
        (("bench", "tables", "toys", "--metric", "map"), "mape"),
    ],
)
def test_mistakes(call, arguments, words):
    with pytest.raises(BsaError, match=words):
        call(*arguments)


def test_an_interrupted_grid_says_that_the_same_command_goes_on(call, monkeypatch):
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(running, "run_campaign", interrupted)
    shown = call("grid", "toys.yaml", "--workers", "1", code=INTERRUPTED).stderr
    assert "The same command goes on" in shown
    assert "Interrupted." not in shown


def test_a_study_that_is_not_run_tells_its_items(call):
    shown = call("bench", "life-discovery", "--data", "nowhere", "--dry-run").output
    assert "life-discovery: 9 runs, 0 of them finished" in shown
    assert "\n  diffusion\n" in shown
    assert "nowhere/calce_cs2/CS2_35_all.csv.gz" in shown
    assert call("bench", "whole-life", "--data", "nowhere", "--dry-run", "--only", "CS2_36").output.count("CS2_3") == 2
    assert not Path("results").exists()
    with pytest.raises(BsaError, match="there is no file"):
        call("bench", "fade-trends", "--data", "x")
