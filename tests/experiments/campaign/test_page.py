"""The page of a grid: complete, safe and, in a browser, alive."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from unittest.mock import Mock

import pytest
from bsa.core.run.journal import Journal
from bsa.experiments.campaign import page
from bsa.experiments.campaign.columns import COLUMNS
from bsa.experiments.campaign.figures import _of_objective
from bsa.experiments.campaign.page import build_page
from bsa.experiments.campaign.running import run_campaign

from .conftest import Here, Quiet

HOSTILE = "</script><script>alert(1)</script><img src=x onerror=y> \u202e\u2028"
BROWSER = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


@pytest.fixture
def finished(make_plan):
    plan = make_plan(tasks=3, summary="What <b>is</b> it worth?", exclude=[{"task": "toy-2", "scaffold": "no-memory"}])
    run_campaign(plan, Here(), Quiet())
    return plan


def block(html: str, name: str):
    return json.loads(re.search(rf'<script type="application/json" id="{name}">(.*?)</script>', html, re.S)[1])


def test_long_words_of_a_round_stand_on_one_line():
    said = Mock(lost="", hypothesis="too thick,\n" * 100, updates={}, trials=(), best=None)
    words = page._round(said)["words"]
    assert words.startswith("too thick, too thick, ")
    assert words.endswith("…")
    assert len(words) == 280
    assert "\n" not in words


def test_an_error_that_is_a_fraction_is_shown_in_percent() -> None:
    row = {column.name: None for column in COLUMNS} | {"capacity_error": 7.75e-4, "mape": 1.5}
    shown = page._shown([row])
    places = {column["name"]: place for place, column in enumerate(shown["columns"])}
    assert shown["columns"][places["capacity_error"]]["title"] == "Capacity error / %"
    (values,) = shown["rows"]
    assert values[places["capacity_error"]] == pytest.approx(0.0775)
    assert values[places["mape"]] == 1.5


@pytest.mark.parametrize(
    ("rows", "label"),
    [
        ([(1.5, 1.5, 20.0), (2.0, 2.0, 30.0)], "total MAPE / %"),
        ([(20.0, None, 20.0)], "voltage RMSE / mV"),
        ([(3.0, None, None)], "RMS misfit / tolerances"),
        ([(1.5, 1.5, 20.0), (30.0, None, 30.0)], "objective"),
    ],
)
def test_the_axis_of_convergence_says_what_was_minimised_with_its_unit(rows, label) -> None:
    names = ("objective", "mape", "v_rmse_mv")
    assert _of_objective([dict(zip(names, row, strict=True)) for row in rows]) == label


@pytest.mark.slow
def test_every_cell_and_its_rounds_are_on_the_page(finished):
    path = build_page("toys", finished.store.root)
    html = path.read_text()
    data, runs = block(html, "data"), block(html, "runs")
    assert len(data["rows"]) == 5
    assert set(runs) == {cell.identity for cell in finished.cells}
    told = runs[finished.cells[0].identity]
    assert len(told["trace"]) == 5
    assert [entry["phase"] for entry in told["rounds"]] == ["warm-up", "search", "search"]
    assert told["rounds"][1]["words"]
    assert told["parameters"][0][0] == "Capacity"
    assert "What &lt;b&gt;is&lt;/b&gt; it worth?" in html
    assert "<span>5 cells</span>" in html
    assert "<span>1 seed</span>" in html


@pytest.mark.slow
def test_a_simulation_without_an_objective_has_no_place_on_the_line(finished):
    """A reduced task, and a simulation with nothing to compare, ran to their ends and have no errors."""
    identity = finished.cells[0].identity
    path = finished.store.cell(identity) / "journal.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    trials = [line for line in lines if line["event"] == "trial"]
    trials[-1] |= {"metrics": None, "residuals": None, "reduction": {"rate": 0.5, "cycles": None}}
    trials[-2] |= {"metrics": None, "residuals": None}
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    trace = block(build_page("toys", finished.store.root).read_text(), "runs")[identity]["trace"]
    assert [value is None for value in trace] == [False] * 3 + [True] * 2


@pytest.mark.slow
def test_the_page_asks_for_nothing(finished):
    html = build_page("toys", finished.store.root).read_text()
    assert not re.findall(r'(?:src|href)="(?!#)[^"]*"', re.sub(r'xmlns(:\w+)?="[^"]*"', "", html))
    assert "default-src 'none'" in html
    # Figures stand side by side without taking each other's identifiers.
    identifiers = re.findall(r'\bid="([^"]+)"', html)
    assert len(identifiers) == len(set(identifiers))


@pytest.mark.slow
def test_reports_are_built_on_demand_and_linked(finished):
    first = block(build_page("toys", finished.store.root).read_text(), "runs")
    assert not any("report" in told for told in first.values())
    path = build_page("toys", finished.store.root, full=True)
    for told in block(path.read_text(), "runs").values():
        assert (path.parent / told["report"]).is_file()


@pytest.mark.slow
def test_large_grids_link_instead_of_embedding(finished, monkeypatch):
    monkeypatch.setattr(page, "MOST_RUNS", 2)
    html = build_page("toys", finished.store.root, full=True).read_text()
    assert all(set(told) == {"report"} for told in block(html, "runs").values())


def hostile(finished) -> str:
    """A cell whose journal speaks evil; its identity."""
    identity = finished.cells[0].identity
    folder = finished.store.cell(identity)
    lines = [json.loads(line) for line in (folder / "journal.jsonl").read_text().splitlines()]
    (folder / "journal.jsonl").unlink()
    journal = Journal(folder)
    for line in lines:
        if line["event"] == "proposal":
            line |= {"hypothesis": HOSTILE, "updates": {HOSTILE: HOSTILE}}
        journal.append(line.pop("event"), **line)
    journal.append("note", text=HOSTILE)
    journal.close()
    return identity


@pytest.mark.slow
def test_what_a_model_said_cannot_leave_its_place(finished):
    identity = hostile(finished)
    html = build_page("toys", finished.store.root).read_text()
    assert html.count("<script") == 3
    assert "<img" not in html
    assert "\u202e" not in html
    assert "alert(1)" in block(html, "runs")[identity]["rounds"][1]["words"]


def dumped(path: Path, address: str, tmp_path: Path) -> str:
    """The page as a browser shows it, after its script."""
    assert BROWSER is not None
    command = [BROWSER, *FLAGS, f"--user-data-dir={tmp_path / 'browser'}", "--dump-dom", f"{path.as_uri()}#{address}"]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
def test_in_a_browser(finished, tmp_path):
    identity = hostile(finished)
    path = build_page("toys", finished.store.root)
    data = block(path.read_text(), "data")
    names = [column["name"] for column in data["columns"]]
    rows = {row["identity"]: row for row in (dict(zip(names, line, strict=True)) for line in data["rows"])}

    def shown(html: str) -> list[str]:
        return re.findall(r'<tr data-cell="([^"]+)"', html)

    plain = dumped(path, "", tmp_path)
    assert shown(plain) == list(rows)
    assert "5 of 5 cells" in plain
    down = shown(dumped(path, "sort=-mape", tmp_path))
    assert [rows[cell]["mape"] for cell in down] == sorted((row["mape"] for row in rows.values()), reverse=True)
    few = dumped(path, "method=no-memory&find=TOY-1&sort=mape", tmp_path)
    assert [(rows[cell]["method"], rows[cell]["task"]) for cell in shown(few)] == [("no-memory", "toy-1")]
    assert "1 of 5 cells" in few
    told = dumped(path, f"cell={identity}", tmp_path)
    assert re.search(r'<dialog[^>]* open="">', told)
    dialog = told[told.index("<dialog") : told.index("</dialog>")]
    assert "warm-up 1, 2 simulations" in dialog
    assert "<polyline" in dialog
    assert "&lt;img src=x" in dialog
    assert "<img" not in dialog
    assert "Capacity" in dialog
