"""Nothing is written where something else than a result of ours lies, and nothing is left by what was refused."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from bsa.core.encoding import encode_task
from bsa.core.run.journal import FILE_NAME
from bsa.experiments.cli.main import main
from bsa_toy_cell import toy_task

FOREIGN = "not ours\n"
RECORD = "Test Time / s,Voltage / V,Current / A\n" + "\n".join(
    f"{10 * k},{4.1 - 0.001 * k:.4f},{-1.0 if k > 2 else 0.0}" for k in range(60)
)

Call = Callable[..., str]


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Call:
    """Call the command and give what it says; it must end with exit code 2 and one line, and write nothing."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "record.csv").write_text(RECORD)
    (tmp_path / "toy.json").write_text(json.dumps(encode_task(toy_task())))
    grid = {"name": "toys", "tasks": ["toy.json"], "scaffolds": ["full"], "settings": {"simulator.use": "toy-cell"}}
    (tmp_path / "toys.yaml").write_text(yaml.safe_dump(grid))

    def call(*arguments: str) -> str:
        before = tree(tmp_path)
        monkeypatch.setattr(sys, "argv", ["bsa", *arguments])
        with pytest.raises(SystemExit) as caught:
            main()
        shown = capsys.readouterr()
        assert caught.value.code == 2, shown.err
        assert "Traceback" not in shown.err + shown.out
        assert tree(tmp_path) == before
        return next(line for line in shown.err.splitlines() if line.startswith("BsaError: "))

    return call


def tree(folder: Path) -> dict[str, bytes | str]:
    """Everything in a folder, with content."""
    return {
        str(path): str(path.readlink()) if path.is_symlink() else path.read_bytes() if path.is_file() else ""
        for path in sorted(folder.rglob("*"))
    }


def folder_with(name: str, *names: str, content: str = FOREIGN) -> Path:
    """A folder with files in it."""
    for file in names:
        path = Path(name, file)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    return Path(name)


OUTS: list[tuple[str, ...]] = [
    ("run", "demo", "--out"),
    ("discover", "--data", "record.csv", "--parameters", "Chen2020", "--out"),
    ("grid", "toys.yaml", "--store"),
    ("bench", "suite", "--out"),
    ("bench", "runtime", "--out"),
    ("bench", "no-harm", "--out"),
    ("bench", "discovery", "make"),
]


@pytest.mark.parametrize("command", OUTS, ids=" ".join)
def test_a_place_that_is_not_ours(command: tuple[str, ...], refused: Call) -> None:
    folder_with("thesis", "result.json", "report.html", "discovery.json", "cells.csv", "table.md", "answers.sealed")
    Path("file").write_text(FOREIGN)
    Path("dangling").symlink_to("nowhere")
    Path("linked").symlink_to("thesis")
    for place in ("thesis", "linked"):
        assert "nothing was written" in refused(*command, place)
    for place in ("file", "dangling", "file/inside", "x" * 300):
        assert place[:60] in refused(*command, place)


@pytest.mark.parametrize("content", [FOREIGN, "a log without an end", '{"event":"login"}\n{"torn'])
def test_a_foreign_journal(content: str, refused: Call) -> None:
    folder_with("logs", FILE_NAME, content=content)
    assert "not the journal of a run" in refused("run", "demo", "--out", "logs")
    assert "logs" in refused("run", "--resume", "logs")


def test_a_link_for_a_journal(refused: Call) -> None:
    folder_with("own", FILE_NAME, content='{"event":"run"}\n{"torn')
    folder_with("logs", "note")
    Path("logs", FILE_NAME).symlink_to("../own/journal.jsonl")
    assert "nothing was written" in refused("run", "demo", "--out", "logs")


@pytest.mark.parametrize(
    "option",
    [
        ("--scaffold", "full", "--set", "proposer.options.nonsense=1"),
        ("--set", "simulator.options.time_limit_s=-1"),
        ("--set", "feedback.use=structurd"),
        ("--data", "record.csv", "--parameters", "Chen2020", "--options", "thermal=nonsense"),
    ],
    ids=" ".join,
)
def test_a_bad_option_leaves_nothing(option: tuple[str, ...], refused: Call) -> None:
    refused("run", *option, "--out", "new")
    assert not Path("new").exists()


def test_a_grid_of_another_making(refused: Call) -> None:
    folder_with("results/grids/toys", "cells.csv", "index.html")
    assert "not a campaign" in refused("grid", "toys.yaml")


@pytest.mark.slow
def test_pages_and_tables_of_another_making(
    refused: Call, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["bsa", "grid", "toys.yaml", "--workers", "1", "--set", "simulations=2"])
    with pytest.raises(SystemExit):
        main()
    capsys.readouterr()
    folder_with("site", "index.html", "cells.csv")
    assert "not a page" in refused("report", "toys", "--out", "site/index.html")
    assert "site" in refused("report", "toys", "--out", "site")
    assert "not tables" in refused("bench", "tables", "toys", "--out", "site")
    for arguments in (["report", "toys", "--out", "page.html"], ["bench", "tables", "toys", "--out", "tables"]):
        for _ in range(2):
            monkeypatch.setattr(sys, "argv", ["bsa", *arguments])
            with pytest.raises(SystemExit) as caught:
                main()
            assert caught.value.code == 0


@pytest.mark.parametrize("name", ["../outside", "/tmp/outside", "thesis", "linked"])
def test_results_of_blind_cases_stay_in_their_folder(name: str, refused: Call) -> None:
    folder_with("blind/grids/thesis", "note")
    records = '[{"file": "slow.csv", "ambient_c": 25}, {"file": "holdout.csv", "ambient_c": 25}]'
    content = f'{{"parameters": "Chen2020", "model": "SPM", "records": {records}}}'
    folder_with("blind/case_01", "case.json", "slow.csv", "holdout.csv", content=content)
    Path("blind", "grids", "linked").symlink_to("thesis")
    assert name in refused("bench", "discovery", "run", "blind", "--results", name)


@pytest.mark.parametrize("content", ["", "[]", '{"parameters": "Chen2020", "model": "SPM", "records": []}'])
def test_a_blind_case_of_another_making(content: str, refused: Call) -> None:
    folder_with("blind/case_01", "case.json", content=content)
    assert "does not read as a blind case" in refused("bench", "discovery", "run", "blind")


def test_control_codes_in_a_name_do_not_reach_the_terminal(refused: Call) -> None:
    assert "\x1b" not in refused("run", "\x1b[31mred\n\x07.yaml")
    assert "\x1b" not in refused("run", "demo", "--data", "\x1b]0;title\x07.csv", "--parameters", "Chen2020")
