"""Whatever a person gets wrong: one line, a hint, exit code 2, no traceback, nothing lost."""

import subprocess
import sys
from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.core.run.journal import FILE_NAME
from bsa.experiments.cli.main import main, run_main
from bsa.experiments.cli.shared_options import Reading
from bsa.experiments.run_settings import key_values, run_config

GOOD_CSV = "Test Time / s,Voltage / V,Current / A\n" + "\n".join(
    f"{10 * k},{4.1 - 0.001 * k:.4f},{-1.0 if k > 2 else 0.0}" for k in range(60)
)
GOOD_TASK = """
name: mine
parameter_set: Chen2020
model: SPM
search: {"Negative particle radius [m]": {factors: [0.5, 2]}}
experiments: [{data: record.csv}]
"""


def told(arguments: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> str:
    """Run the command and give what it says on standard error; it must end with exit code 2."""
    monkeypatch.setattr(sys, "argv", ["bsa-run", *arguments])
    with pytest.raises(SystemExit) as caught:
        run_main()
    assert caught.value.code == 2
    shown = capsys.readouterr()
    assert "Traceback" not in shown.err + shown.out
    return shown.err


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "record.csv").write_text(GOOD_CSV)
    (tmp_path / "task.yaml").write_text(GOOD_TASK)
    return tmp_path


COMMANDS = [
    (["dmeo"], 'there is no task "dmeo"', 'did you mean "demo"'),
    (["missing.yaml"], "missing.yaml does not exist", "check the path"),
    (["--scaffold", "ful"], 'there is no scaffold "ful"', 'did you mean "full"'),
    (["--scaffold", "own.yaml"], "own.yaml does not exist", "check the path"),
    (["--backend", "rulez"], 'there is no backend "rulez"', 'did you mean "rules"'),
    (["--backend", "litellm:"], "names no model", "write litellm:MODEL"),
    (["--backend", "replay:nowhere"], "nowhere", ""),
    (["--set", "patience"], '"patience" is not key=value', 'write --set "key=value"'),
    (["--set", "patiense=3"], "patiense", ""),
    (["--set", "patience=soon"], "\"patience\" is 'soon': a whole number was expected", ""),
    (["--data", "record.csv", "--parameters", "Chen2020", "--cycles", "2-1"], '"2-1" is not a range', 'write "1-2"'),
    (["--data", "record.csv", "--parameters", "Chen2020", "--cycles", "0"], '"0" is not a range', "count from 1"),
    (
        ["--data", "record.csv", "--parameters", "Chen2020", "--options", "therml=lumped"],
        'no model option "therml"',
        'did you mean "thermal"?',
    ),
    (["--set", "feedback.use=structurd"], 'there is no feedback "structurd"', 'did you mean "structured"'),
    (["--set", "proposer.options.free_action=3"], "free_action", 'did you mean "free_actions"'),
    (["--set", "simulator.options.time_limit_s=-1"], "time_limit_s", ""),
    (["--resume", "nowhere"], "nowhere", ""),
    (["--data", "record.csv"], "a record needs a parameter set to start from", "--parameters Chen2020"),
    (["--data", "record.csv", "--parameters", "Chen2021"], 'no parameter set "Chen2021"', 'did you mean "Chen2020"'),
    (["--data", "record.csv", "--parameters", "neares"], 'no parameter set "neares"', 'did you mean "nearest"'),
    (["--data", "absent.csv", "--parameters", "Chen2020"], "absent.csv", ""),
    (["demo", "--data", "record.csv", "--parameters", "Chen2020"], "both a task", "give one of them"),
    (["--data", "first", ".", "--parameters", "Chen2020"], 'both a task (".")', "write --data before each"),
    (["--data", "record.csv", "--parameters", "Chen2020", "--search", "gemoetry"], "gemoetry", "geometry"),
    (["--data", "record.csv", "--parameters", "Chen2020", "--model", "DFM"], 'no model "DFM"', 'did you mean "DFN"'),
    (["--data", "record.csv", "--parameters", "Chen2020", "--sheet", "3"], 'it has no sheet "3"', "leave out --sheet"),
    (["--data", "record.csv", "--parameters", "Chen2020", "--cycles", "one"], '"one" is not a range', "2-5"),
    (["--data", "record.csv", "--parameters", "Chen2020", "--current-sign", "up"], "current_sign", ""),
    (["--data", "record.csv", "--parameters", "Chen2020", "--column", "volts"], "is not key=value", ""),
    (["--data", "record.csv", "--parameters", "Chen2020", "--column", "volts=3"], "volts", ""),
    (["--data", "record.csv", "--parameters", "Chen2020", "--column", "voltage=Ecell"], "Ecell", ""),
    (["--backend", "ollama:m", "--backend-option", "temprature=1"], "temprature", 'did you mean "temperature"'),
    (["--base-url", "127.0.0.1"], "--base-url does not go with the backend rules", ""),
    (["--backend", "openai:m", "--base-url", "http://127.0.0.1:99999/v1"], "Port out of range", ""),
]


@pytest.mark.parametrize(("arguments", "wrong", "hint"), COMMANDS, ids=lambda value: str(value)[:50])
def test_a_mistyped_command(
    arguments: list[str],
    wrong: str,
    hint: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    message = told(arguments, capsys, monkeypatch)
    line = next(line for line in message.splitlines() if line.startswith("BsaError: "))
    assert wrong in line
    assert hint in line
    assert not list(Path().glob("runs/*/result.json"))


@pytest.mark.parametrize("login", ["me:hunter2", "me:hunt/er2", "me:" + "x" * 40 + "hunter2"])
@pytest.mark.parametrize("option", ["--base-url=", "--backend-option=base_url="])
def test_no_password_of_an_address_is_shown(
    login: str, option: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    message = told(["--backend", "openai:m", f"{option}http://{login}@127.0.0.1:1/v1"], capsys, monkeypatch)
    assert "base_url" in message
    assert "er2" not in message
    assert "xxx" not in message
    assert not any(b"er2" in path.read_bytes() for path in Path().rglob("*") if path.is_file())


def test_a_mistyped_discovery(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    asked = ["--data", "record.csv", "--parameters", "Chen2020", "--out", "found", "--backend", "openai:m"]
    monkeypatch.setattr(sys, "argv", ["bsa", "discover", *asked, "--backend-option", "temprature=1"])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert 'did you mean "temperature"' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (["--parameters", "Chen202"], "Chen202"),
        (["--model", "P2D"], "P2D"),
        (["--effect", "contact-resistence"], 'did you mean "contact-resistance"'),
        (["--search", "capcity"], 'did you mean "capacity"'),
    ],
)
def test_a_refused_discovery_names_no_folder(
    wrong: list[str], words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    asked = ["--data", "record.csv", "--parameters", "Chen2020", "--model", "SPM", *wrong, "--out", "found"]
    monkeypatch.setattr(sys, "argv", ["bsa", "discover", *asked])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    assert not (folder / "found").exists()


TASKS = [
    ("parameter_set: Chen2020", "parameter_sett: Chen2020", '"parameter_sett" is not a known key'),
    ("name: mine", "nome: mine", "nome"),
    ("model: SPM", "model: [SPM", "is not valid YAML at line"),
    ("experiments: [{data: record.csv}]", "experiments: []", '"experiments" is []'),
    ("experiments: [{data: record.csv}]", "experiments: [{data: gone.csv}]", "gone.csv"),
    ("data: record.csv", "data: record.csv, initial_soc: 2", "initial_soc"),
    ("data: record.csv", "data: record.csv, scored_cycle: 7", "scored_cycle is 7"),
    ("name: mine", "name: !!int abc", "is no int"),
    ("name: mine", "name: " + "[" * 3000, "more than 50 levels"),
    ("model: SPM", "model: 2020-13-45", 'no model "2020-13-45"'),
    ("data: record.csv", "data: record.csv, initial_soc: " + "9" * 6000, "is no int"),
    ("data: record.csv", "data: record.csv, protocol: [[Dance]]", 'cannot read the step "Dance"'),
    ("Negative particle radius [m]", "Negative particle radius", 'did you mean "Negative particle radius [m]"'),
    ("factors: [0.5, 2]", "factors: [1.5, 2]", "lies outside"),
    ("factors: [0.5, 2]", "lower: 2, upper: 1", "lower < upper must hold"),
    (GOOD_TASK, "just words", "task.yaml"),
    (GOOD_TASK, "", "task.yaml"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("old", "new", "words"), TASKS, ids=lambda value: str(value)[:40])
def test_a_broken_task_file(
    old: str,
    new: str,
    words: str,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (folder / "task.yaml").write_text(GOOD_TASK.replace(old, new))
    message = told(["task.yaml", "--rounds", "0", "--warmup", "0"], capsys, monkeypatch)
    assert words in next(line for line in message.splitlines() if line.startswith("BsaError: "))


def test_a_file_that_is_not_text(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "record.csv").write_bytes(bytes(range(256)) * 50)
    assert "record.csv" in told(["--data", "record.csv", "--parameters", "Chen2020"], capsys, monkeypatch)


def test_another_run_in_the_folder_is_not_overwritten(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = '{"event":"run","format":1,"config":{},"versions":{},"task":{}}\n'
    (folder / "old").mkdir()
    (folder / "old" / FILE_NAME).write_text(kept)
    message = told(["demo", "--out", "old"], capsys, monkeypatch)
    assert "belongs to another task or configuration" in message
    assert (folder / "old" / FILE_NAME).read_text() == kept


def test_help_is_quick_and_needs_no_heavy_library() -> None:
    code = (
        "import sys; sys.argv = ['bsa', '--help']\n"
        "from bsa.experiments.cli.main import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "heavy = {'pybamm', 'torch', 'litellm', 'ollama', 'matplotlib', 'scipy', 'numpy'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "calibrat" in done.stdout.casefold()


def test_options_about_the_record_are_text() -> None:
    read = Reading(column=["time=1e3"], unit=["current=off"], where=["Step=010", "On=yes"]).readings()[0].options
    assert read.columns == {"time": "1e3"}
    assert read.units == {"current": "off"}
    assert read.where == {"Step": "010", "On": "yes"}


def test_where_takes_the_rows_that_say_the_same(folder: Path) -> None:
    lines = GOOD_CSV.splitlines()
    steps = ["Step", *("010" if k < 40 else "8" for k in range(60))]
    (folder / "steps.csv").write_text("\n".join(f"{line},{step}" for line, step in zip(lines, steps, strict=True)))
    read = Reading(where=["Step=010"]).readings()[0].options
    assert len(read_record(folder / "steps.csv", read).trajectory) == 40


def test_settings_keep_the_values_of_yaml() -> None:
    assert key_values(["a=010", "b=[1, x]", "c=", "d=2020-13-45", "e=[[["], "--set") == {
        "a": 8,
        "b": [1, "x"],
        "c": None,
        "d": "2020-13-45",
        "e": "[[[",
    }


def test_a_warm_up_is_chosen_where_the_scaffold_has_none() -> None:
    config = run_config("least-squares", "rules", {}, {"warm_up": 2, "warm_up.use": "random"})
    assert config.warm_up == 2
    assert config.scaffold.warm_up is not None
    assert config.scaffold.warm_up.use == "random"


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("patiense", 'did you mean "patience"? Settings of a run: scaffold, backend,'),
        ("feedbak.use", 'did you mean "feedback"?'),
        ("zz", "Settings of a run: "),
    ],
)
def test_a_setting_is_looked_for_among_those_of_the_run_and_of_its_scaffold(key: str, hint: str) -> None:
    with pytest.raises(BsaError) as found:
        run_config("hybrid", "rules", {}, {key: 5})
    assert found.value.message == f'--set {key}: there is no setting "{key}".'
    assert found.value.hint.startswith(hint)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--model", "SPM"], "--model goes with records"),
        (["--effect", "contact-resistance", "--temperature", "40"], "--effect, options for reading go with records"),
        (["--reader", "neware"], "options for reading go with records"),
        (["--reader-option", "foo=1"], "options for reading go with records"),
        (["--life", "--no-scale", "--initial-soc", "0.5"], "--no-scale, --initial-soc, --life go with records"),
    ],
)
def test_what_goes_with_records_is_refused_for_a_task(
    options: list[str], words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert words in told(["demo", *options], capsys, monkeypatch)
