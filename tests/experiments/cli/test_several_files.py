from pathlib import Path

import pytest
import typer
from bsa.core.errors import BsaError
from bsa.experiments.cli.main import app
from bsa.experiments.cli.several_files import one_option_a_file
from bsa.experiments.run_names import named_after
from typer.testing import CliRunner


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("--data a.csv b.csv c.CSV --model DFN", "--data a.csv --data b.csv --data c.CSV --model DFN"),
        ("--data a.csv --data b.csv", "--data a.csv --data b.csv"),
        ("--data=a.csv b.csv", "--data=a.csv --data b.csv"),
        ("--data r.mat#T25/1C r.mat#T25/2C", "--data r.mat#T25/1C --data r.mat#T25/2C"),
        ("--data a.csv b.csv --holdout c.csv d.csv", "--data a.csv --data b.csv --holdout c.csv --holdout d.csv"),
        ("--data a.csv --reference b.csv c.csv", "--data a.csv --reference b.csv --reference c.csv"),
        ("--data a.csv regular-134", "--data a.csv regular-134"),
        ("--data a.csv task.yaml", "--data a.csv task.yaml"),
        ("--data a.csv TASK.YAML", "--data a.csv TASK.YAML"),
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


@pytest.fixture
def discharges(tmp_path: Path) -> list[str]:
    """Three files of two hours, half an hour and an hour, without a current."""
    paths = [tmp_path / name for name in ("slow.txt", "fast.txt", "held.txt")]
    for path, seconds in zip(paths, (7200, 1800, 3600), strict=True):
        path.write_text("".join(f"{seconds * n / 100}\t{4.1 - 0.01 * n:.3f}\n" for n in range(101)))
    return [str(path) for path in paths]


COLUMNS = ["--column", "time=1", "--column", "voltage=2"]


@pytest.mark.slow
def test_each_file_has_the_current_and_the_temperature_in_its_place(discharges: list[str], monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr("bsa.experiments.run.execute_run", lambda task, *others, **more: asked.append(task))
    currents = [f"--constant-current={current}" for current in (-1.0, -4.0, -2.0)]
    temperatures = [f"--temperature={degc}" for degc in (25, 10, 0)]
    records = ["--data", *discharges[:2], "--holdout", discharges[2], *COLUMNS, *currents, *temperatures]
    cell = ["--parameters", "Chen2020", "--model", "SPM", "--out", str(tmp_path / "run")]
    CliRunner().invoke(app(), ["run", *records, *cell])
    (task,) = asked
    read = [*task.experiments, *task.held_out]
    assert [record.target.current.max() for record in read] == [1.0, 4.0, 2.0]
    assert [record.temperature_k for record in read] == [298.15, 283.15, 273.15]


def test_numbers_for_another_number_of_files_are_refused(discharges: list[str]) -> None:
    def said(*options: str) -> BsaError:
        found = CliRunner().invoke(app(), ["data", *discharges, *COLUMNS, *options]).exception
        assert isinstance(found, BsaError)
        return found

    assert "given 2 times for 3 records" in said("--constant-current=-1", "--constant-current=-4").message
    twice_and_thrice = ["--constant-current=-1"] * 2 + ["--temperature=10"] * 3
    assert said(*twice_and_thrice).message == "--constant-current 2 times, --temperature 3 times were given."


def test_an_option_without_a_file_and_a_run_whose_name_has_a_point(tmp_path, monkeypatch):
    with pytest.raises(BsaError, match="--data has no value"):
        one_option_a_file(["--data", "--parameters", "Chen2020"])
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.v2").mkdir()
    (tmp_path / "run.v2" / "journal.jsonl").write_text("{}\n")
    assert one_option_a_file(["--data", "a.csv", "run.v2"]) == ["--data", "a.csv", "run.v2"]
