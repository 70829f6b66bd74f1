"""A simulator that is no battery: found, calibrated and reported by the same commands, in its own words."""

import contextlib
import html
import io
import json
import re
import sys
from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.cli.main import main, run_main
from bsa.experiments.report.page import build_report
from bsa.experiments.run import read_request
from bsa.experiments.tasks.find import find_task
from bsa_oscillator import DAMPING, HIDDEN, MASS, OSCILLATOR, STIFFNESS

CLOSE = {MASS: 0.002, STIFFNESS: 0.002, DAMPING: 0.005}
"""Relative errors that are allowed: some five standard deviations of what the record's noise leaves open."""

OF_A_CELL = re.compile(
    r"""\b(volt\w*|mv|lithium|li-ion|cells?|electro\w*|batter\w*|currents?|charg\w*|discharg\w*|capacit\w*|a[.\s]?h
    |amperes?|amps?|cyclers?|mape|polaris\w*|c-rate|soc|state\ of\ charge|pybamm|cathodes?|anodes?|particles?|pores?
    |mesh)\b""",
    re.IGNORECASE | re.VERBOSE,
)

OURS = re.compile(r"battery-sim-agent( \d[\w.]*)?|pybamm \d[\w.]*")
"""The product's own name, and the versions of what is installed with it."""


def words_of_a_cell(text: str) -> list[str]:
    text = OURS.sub("", text)
    return [text[max(found.start() - 40, 0) : found.end() + 40] for found in OF_A_CELL.finditer(text)]


def command(arguments: list[str], entry: object = run_main) -> str:
    """What a command prints on both channels; it must end with exit code 0."""
    said, before = io.StringIO(), sys.argv
    sys.argv = ["bsa", *arguments]
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), pytest.raises(SystemExit) as ended:
            entry()  # type: ignore[operator]
    finally:
        sys.argv = before
    assert ended.value.code in (0, None), said.getvalue()
    return said.getvalue()


@pytest.fixture(scope="module", params=[pytest.param(name, marks=pytest.mark.slow) for name in ("full", "hybrid")])
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of a run, and what the terminal showed."""
    folder = tmp_path_factory.mktemp(request.param) / "run"
    return folder, command(["oscillator", "--scaffold", request.param, "--workers", "1", "--out", str(folder)])


def events(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "journal.jsonl").read_text().splitlines()]


def test_the_hidden_values_are_found(run: tuple[Path, str]) -> None:
    best = json.loads((run[0] / "best_parameters.json").read_text())
    for name, allowed in CLOSE.items():
        assert best[name] == pytest.approx(HIDDEN[name], rel=allowed)


def test_the_result_is_named_after_the_signals(run: tuple[Path, str]) -> None:
    result = json.loads((run[0] / "result.json").read_text())
    assert set(result["initial"]) == {"objective", "displacement_rmse_mm", "velocity_rmse_mm_s"}
    assert result["best"]["objective"] < 1.0 < result["initial"]["objective"]
    # The noise of the sensors is what is left.
    assert result["best"]["displacement_rmse_mm"] == pytest.approx(0.2, rel=0.1)
    assert result["identifiability"]["measure_next"] == []


def test_nothing_that_the_model_is_told_speaks_of_a_cell(run: tuple[Path, str]) -> None:
    calls = [event for event in events(run[0]) if event["event"] == "reply"]
    assert calls
    for call in calls:
        for turn in call["prompt"]:
            assert words_of_a_cell(turn["text"]) == []
        assert words_of_a_cell(call["text"]) == []
    opening = calls[0]["prompt"][0]["text"]
    assert opening.startswith(OSCILLATOR.expert)
    assert "a positive lag means that the simulated swing comes late" in opening


def test_neither_the_report_nor_the_terminal_speaks_of_a_cell(run: tuple[Path, str]) -> None:
    folder, terminal = run
    page = html.unescape((folder / "report.html").read_text())
    assert words_of_a_cell(page) == []
    assert words_of_a_cell(terminal) == []
    for shown in ("Displacement / m", "Velocity / m/s", "Force / N", "Residual / mm", "RMS misfit"):
        assert shown in page
    assert "(a tolerance is 0.2 mm of displacement, 2 mm/s of velocity)" in page
    assert re.search(r"displacement RMSE +17\.\d+ → 0\.19\d+ mm", terminal)


@pytest.mark.slow
def test_its_journal_alone_brings_everything_back(run: tuple[Path, str]) -> None:
    folder, _ = run
    task, config = read_request(folder)
    assert task.domain == OSCILLATOR
    assert config.scaffold.simulator.use == "oscillator"
    before = (folder / "report.html").read_text()
    build_report(folder)
    assert (folder / "report.html").read_text() == before
    count = len(events(folder))
    command(["--resume", str(folder)])
    assert [event["event"] for event in events(folder)[count:]] == ["resumed", "end"]


def test_the_words_of_a_cell_are_found_where_they_are() -> None:
    assert words_of_a_cell("total MAPE of a lithium-ion cell in mV, battery-sim-agent 1.0, pybamm 26.1") != []
    assert words_of_a_cell("written by battery-sim-agent, pybamm 26.10.1; the spring excelled") == []


def test_the_task_is_listed_with_its_origin_and_found_by_its_name() -> None:
    listing = command(["list", "tasks"], main)
    assert re.search(r"oscillator +A damped driven oscillator, .* \(bsa-oscillator 1\.0\)", listing)
    assert find_task("oscillator").simulator == "oscillator"
    with pytest.raises(BsaError, match='did you mean "oscillator"'):
        find_task("oscilator")


@pytest.mark.slow
def test_a_grid_of_it_compares_its_own_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    grid = {"name": "bench", "tasks": ["oscillator"], "scaffolds": ["default", "least-squares"], "simulations": 20}
    Path("bench.json.yaml").write_text(json.dumps(grid | {"seeds": [1]}))
    said = command(["grid", "bench.json.yaml", "--store", "store", "--workers", "1"], main)
    assert re.search(r"own, RMS misfit, tolerances: damped driven oscillator\n +default +84\.29", said)
    page = Path(command(["report", "bench", "--store", "store"], main).strip())
    assert "RMS misfit, tolerances" in page.read_text()
    assert "total MAPE" not in page.read_text()


@pytest.mark.parametrize("scaffold", ["qnehvi", "weighted-de"])
def test_a_scaffold_that_needs_the_papers_errors_says_so(
    scaffold: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["bsa-run", "oscillator", "--scaffold", scaffold, "--out", str(tmp_path / "run")])
    with pytest.raises(SystemExit) as ended:
        run_main()
    assert ended.value.code == 2
    assert "needs the errors of charge, current and voltage" in capsys.readouterr().err


def test_pybamm_refuses_a_task_that_is_no_cell(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["bsa-run", "oscillator", "--set", "simulator.use=pybamm", "--out", str(tmp_path / "run")]
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as ended:
        run_main()
    assert ended.value.code == 2
    assert "has the signals ['force', 'displacement', 'velocity']" in capsys.readouterr().err
