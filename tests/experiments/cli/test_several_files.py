from pathlib import Path

import pytest
import typer
from bsa.core.errors import BsaError
from bsa.experiments.cli.main import app
from bsa.experiments.cli.several_files import one_option_a_file
from bsa.experiments.request import named_after
from typer.testing import CliRunner


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("--data a.csv b.csv c.CSV --model DFN", "--data a.csv --data b.csv --data c.CSV --model DFN"),
        ("--data a.csv --data b.csv", "--data a.csv --data b.csv"),
        ("--data=a.csv b.csv", "--data=a.csv --data b.csv"),
        ("--data r.mat#T25/1C r.mat#T25/2C", "--data r.mat#T25/1C --data r.mat#T25/2C"),
        ("--data a.csv b.csv --holdout c.csv d.csv", "--data a.csv --data b.csv --holdout c.csv --holdout d.csv"),
        ("--data a.csv regular-134", "--data a.csv regular-134"),
        ("--data a.csv task.yaml", "--data a.csv task.yaml"),
        ("--data record", "--data record"),
        ("demo --data a.csv", "demo --data a.csv"),
        ("--data a.csv -- b.csv", "--data a.csv -- b.csv"),
        ("--column a.csv b.csv", "--column a.csv b.csv"),
        ("--data a.csv --no-scale b.csv", "--data a.csv --no-scale b.csv"),
    ],
)
def test_what_follows_an_option_of_records(typed: str, meant: str) -> None:
    assert one_option_a_file(typed.split()) == meant.split()


def test_a_file_without_an_ending_is_a_record_where_it_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "record").write_text("1")
    (tmp_path / "demo").mkdir()
    assert one_option_a_file(["--data", "a.csv", "record", "demo"]) == ["--data", "a.csv", "--data", "record", "demo"]


@pytest.mark.parametrize("command", ["run", "discover"])
def test_both_commands_take_every_file(command: str, tmp_path: Path) -> None:
    names = ["a b.csv", "c.csv", "d.csv"]
    for name in names:
        (tmp_path / name).write_text("time,voltage\n0,3.7\n")
    parsed = typer.main.get_command(app()).commands[command]  # type: ignore[attr-defined]
    out = ["--out", str(tmp_path / "out")]
    context = parsed.make_context(
        command, ["--data", *(str(tmp_path / name) for name in names), "--parameters", "Chen2020", *out]
    )
    assert [Path(path).name for path in context.params["data"]] == names


def test_a_task_after_the_records_is_still_a_task() -> None:
    result = CliRunner().invoke(app(), ["run", "--data", "a.csv", "b.csv", "regular-134", "--parameters", "Chen2020"])
    assert isinstance(result.exception, BsaError)
    assert '"regular-134"' in result.exception.message


def test_a_run_of_several_records_says_how_many() -> None:
    assert named_after([Path("dir/a.csv")]) == "a"
    assert named_after([Path("dir/a.csv"), Path("b.csv"), Path("c.csv")]) == "a and 2 more"
