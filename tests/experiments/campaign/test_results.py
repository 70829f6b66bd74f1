"""The tidy table, the paper's tables and the figures."""

import csv
import json
import math
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from bsa.core.contracts.registry import Registry
from bsa.core.errors import BsaError
from bsa.core.files import write_json
from bsa.core.hooks import Entry, hookimpl
from bsa.core.scaffold import PluginChoice
from bsa.experiments.campaign import estimate as estimates
from bsa.experiments.campaign.calibration import Calibration
from bsa.experiments.campaign.estimate import estimate, experience, need_of
from bsa.experiments.campaign.figures import _medians, convergence, pareto
from bsa.experiments.campaign.results import rows_of, write_rows
from bsa.experiments.campaign.running import run_campaign
from bsa.experiments.campaign.store import Store
from bsa.experiments.campaign.tables import EFFORT, Campaign, blocks, effort, latex, markdown, open_campaign, tables
from bsa.experiments.campaign.trace import read_trace

from .conftest import Here, Quiet, noted


@pytest.fixture
def finished(make_plan):
    plan = make_plan()
    run_campaign(plan, Here(), Quiet())
    return plan


def test_one_row_a_cell_in_csv_and_parquet(finished):
    folder = finished.store.grid("toys")
    with (folder / "cells.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["task"], row["method"], row["state"]) for row in rows] == [
        (task, method, "done") for task in ("toy-0", "toy-1") for method in ("full", "no-memory")
    ]
    parquet = pytest.importorskip("pyarrow.parquet", reason='pip install "battery-sim-agent[cluster]"')
    table = parquet.read_table(folder / "cells.parquet").to_pylist()
    assert [row["identity"] for row in table] == [row["identity"] for row in rows]
    assert float(rows[0]["mape"]) == table[0]["mape"]
    assert isinstance(table[0]["seed"], int)


@pytest.mark.slow
def test_tables_and_figures_are_written(finished):
    written = {path.name: path for path in tables("toys", finished.store.root)}
    assert {"cells.csv", "tables.md", "tables.tex", "by-mode.svg", "convergence.svg", "effort.svg"} <= set(written)
    for name, path in written.items():
        if name.endswith(".svg"):
            ElementTree.fromstring(path.read_text())
    text = written["tables.md"].read_text()
    assert "| full |" in text
    assert "too few cases" in text
    again = {path.name: path.read_bytes() for path in tables("toys", finished.store.root)}
    assert {name: path.read_bytes() for name, path in written.items()} == again


def test_a_price_that_is_not_known_is_no_zero(finished):
    """A mean of the known ones, a dash where there is none; in the figure the method has no point."""
    rows = [dict(row) for row in rows_of(noted(finished), finished.store)]
    priced, unknown = ([row for row in rows if row["method"] == method] for method in ("full", "no-memory"))
    priced[0]["cost_usd"], priced[1]["cost_usd"] = 4.0, None
    for row in unknown:
        row["cost_usd"] = None
    campaign = Campaign({"name": "toys"}, ["full", "no-memory"], rows, finished.store, Path(), "mape")
    heads = list(EFFORT)
    assert effort(rows)["full"][heads.index("cost_usd")] == 4.0
    line = next(line for line in markdown(campaign).splitlines()[::-1] if line.startswith("| no-memory |"))
    assert line.split(" | ")[heads.index("cost_usd") + 1] == "–"
    assert line.split(" | ")[heads.index("tokens") + 1] == "0"
    assert "cost / $" in pareto(rows, "mape")
    assert math.isnan(_medians(rows, "no-memory", "cost_usd", "mape")[0])


def test_the_legend_of_convergence_has_every_method(finished):
    """One that has run in the first mode alone, too."""
    rows = [dict(row) for row in rows_of(noted(finished), finished.store)]
    rows[-1]["mode"] = "extreme"
    assert [row["method"] for row in rows if row["mode"] == "extreme"] == ["no-memory"]
    drawn = convergence(rows, finished.store)
    assert ">full<" in drawn
    assert drawn.count(">no-memory<") == 1


def test_a_grid_that_was_never_run_says_so(finished):
    with pytest.raises(BsaError, match="has not been run"):
        tables("other", finished.store.root)


def test_traces_survive_the_loss_of_their_file(finished):
    identity = finished.cells[0].identity
    folder = finished.store.cell(identity)
    kept = read_trace(folder)
    (folder / "trace.json").unlink()
    again = read_trace(folder)
    assert (again.objective, again.phase) == (kept.objective, kept.phase)
    assert len(kept.objective) == 5
    assert kept.phase == "iwwss"
    assert [entry.simulations for entry in kept.rounds] == [1, 1]


def test_dry_run_learns_from_finished_cells(finished, make_plan):
    more = make_plan(seeds=[1, 2])
    needs = estimate(more.cells, more.store)
    assert [(need.cells, need.simulations, need.learnt) for need in needs.values()] == [(2, 10, True)] * 2
    assert 0 < needs["full · rules"].seconds < 60
    fresh = make_plan(store="fresh", backends=["litellm:some/model"])
    (need, _) = estimate(fresh.cells, fresh.store).values()
    assert need.tokens > 0
    assert need.cost_usd is None
    priced = make_plan(store="fresh", backends=[{"use": "litellm:some/model", "usd_per_million_tokens": 2.0}])
    (need, _) = estimate(priced.cells, priced.store).values()
    assert need.cost_usd == pytest.approx(need.tokens * 2e-6)


@pytest.mark.parametrize("asks", [True, False])
def test_a_proposer_of_a_plugin_says_whether_it_asks_the_model(make_plan, monkeypatch, asks):
    entry = Entry("zz-asker", lambda options, context: None, "Asks.", api=1, asks_model=asks)
    registry = Registry()
    registry.register(SimpleNamespace(bsa_proposers=hookimpl(lambda: [entry])), "zz", "zz-asks 0.1")
    (cell,) = make_plan(tasks=1, scaffolds=["full"], backends=["litellm:some/model"]).cells
    scaffold = cell.config.scaffold.model_copy(update={"proposer": PluginChoice(use="zz-asker")})
    monkeypatch.setattr(estimates, "installed", registry.collect)
    need = need_of(replace(cell, config=cell.config.model_copy(update={"scaffold": scaffold})), {})
    assert (need.calls > 0, need.tokens > 0) == (asks, asks)


@pytest.mark.parametrize(
    ("status", "allowed", "budget", "share"),
    [
        ("simulations-spent", 0, (12, 40), 4.0),
        ("simulations-spent", 0, (12, 5), 0.5),
        ("rounds-spent", 6, (6, 40), 1.0),
        ("rounds-spent", 6, (12, 40), 2.0),
        ("rounds-spent", 6, (60, 40), 4.0),
        ("converged", 0, (60, 40), 1.0),
        ("converged", 0, (60, 5), 0.5),
    ],
)
def test_what_finished_cells_took_is_scaled_to_the_budget(make_plan, status, allowed, budget, share):
    """They made 10 simulations; where a run ends for its budget it takes a larger one, and else it ends again."""
    rounds, simulations = budget
    (cell,) = make_plan(tasks=1, scaffolds=["full"], rounds=rounds, simulations=simulations).cells
    known = row("full", "Chen2020", 1.0, status=status, simulations=10, rounds=allowed)
    known |= {"wall_s": 60.0, "tokens": 9000, "llm_calls": 3, "cost_usd": 0.1}
    need = need_of(cell, {("own", cell.task.chemistry, "full", "rules"): [known]})
    assert (need.simulations, need.tokens, need.learnt) == (simulations, 9000 * share, True)
    assert (need.seconds, need.cost_usd) == pytest.approx((60.0 * share, 0.1 * share))


def test_lives_do_not_tell_what_two_cycles_take(make_plan):
    plan = make_plan(tasks=1, scaffolds=["full"])
    run_campaign(plan, Here(), Quiet())
    (cell,) = make_plan(tasks=1, scaffolds=["full"], seeds=[2]).cells
    life = replace(cell, task=replace(cell.task, mode="life"))
    past = experience(plan.store)
    assert [need_of(one, past).learnt for one in (cell, life)] == [True, False]


def test_how_many_rounds_a_finished_cell_was_allowed_stands_in_its_journal(make_plan):
    plan = make_plan(tasks=1, scaffolds=["full"], rounds=2, warm_up=0, simulations=50)
    run_campaign(plan, Here(), Quiet())
    ((known,),) = experience(plan.store).values()
    assert (known["status"], known["rounds"]) == ("rounds-spent", 2)


def row(method, chemistry, mape, task="a", mode="regular", **more):
    values = {
        "grid": "g", "task": task, "mode": mode, "chemistry": chemistry, "rates": "", "method": method, "seed": 1,
        "state": "done" if mape is not None else "failed", "mape": mape, "rmse": mape, "v_rmse_mv": mape,
        "simulations": 1, "failed_simulations": 0, "llm_calls": 0, "tokens": 0, "cost_usd": 0.0, "wall_s": 1.0,
    }  # fmt: skip
    return {**values, **more}


def campaign_of(rows, *methods):
    return Campaign({}, list(methods), rows, Store(Path()), Path(), "mape")


def test_best_is_bold_and_second_underlined():
    rows = [
        row("a", "Chen2020", 1.0), row("a", "Chen2020", 3.0, "b"), row("b_1", "Chen2020", 5.0),
        row("c", "Chen2020", 0.5), row("c", "Chen2020", None, "b"), row("a", "Ai2020", 2.0), row("b_1", "Ai2020", 1.0),
    ]  # fmt: skip
    (block,) = blocks(rows, "mape")
    assert block.columns == ("Chen2020", "Ai2020", "all")
    campaign = campaign_of(rows, "a")
    text = markdown(campaign)
    assert "| a | <u>2.00 ± 1.41</u> | <u>2.00</u> | <u>2.00 ± 1.00</u> | 3 |" in text
    assert "| c | **0.50** (1 without result) | – | **0.50** (1 without result) | 1 |" in text
    tex = latex(campaign)
    assert r"a & \underline{2.00 $\pm$ 1.41} & \underline{2.00} & \underline{2.00 $\pm$ 1.00} & 3 \\" in tex
    assert r"b\_1 & " in tex


def test_rows_of_cells_that_were_not_run(make_plan, tmp_path):
    plan = make_plan()
    rows = rows_of(noted(plan), plan.store)
    assert [entry["state"] for entry in rows] == ["missing"] * 4
    write_rows(rows, tmp_path / "out")
    assert "4 without a result" in markdown(campaign_of(rows, "full"))


def test_a_cell_that_was_interrupted_is_stopped_and_only_its_rest_is_to_be_done(finished):
    cell = finished.cells[0]
    folder = finished.store.cell(cell.identity)
    (folder / "result.json").unlink()
    lines = (folder / "journal.jsonl").read_bytes().splitlines(keepends=True)
    kept = [line for line in lines if json.loads(line)["event"] in ("run", "trial")][:3]
    (folder / "journal.jsonl").write_bytes(b"".join(kept))
    states = {row["identity"]: (row["state"], row["reason"]) for row in rows_of(noted(finished), finished.store)}
    assert states.pop(cell.identity) == ("stopped", "interrupted")
    assert set(states.values()) == {("done", "")}
    assert sum(need.simulations for need in estimate(finished.cells, finished.store).values()) == 5 - 2


def test_a_cell_that_failed_and_is_interrupted_when_it_is_run_again_is_stopped(make_plan, monkeypatch):
    plan = make_plan(tasks=1, scaffolds=["full"])
    (cell,) = plan.cells
    (plan.store.cell(cell.identity)).mkdir(parents=True)
    (plan.store.cell(cell.identity) / "failure.json").write_text('{"reason": "no server"}')
    (before,) = rows_of(noted(plan), plan.store)
    assert (before["state"], before["reason"]) == ("failed", "no server")

    def interrupted(cell, folder, store):
        (folder / "journal.jsonl").write_text('{"event":"run"}\n')
        raise KeyboardInterrupt

    monkeypatch.setattr(Calibration, "run", interrupted)
    run_campaign(plan, Here(), Quiet())
    (after,) = rows_of(noted(plan), plan.store)
    assert (after["state"], after["reason"]) == ("stopped", "interrupted")


def test_a_cell_that_was_interrupted_and_failed_when_it_was_run_again_has_failed(make_plan, monkeypatch):
    plan = make_plan(tasks=1, scaffolds=["full"])
    (cell,) = plan.cells
    interrupted = {"status": "interrupted", "best": {}, "initial": {}}
    write_json(plan.store.cell(cell.identity) / "result.json", interrupted)
    (before,) = rows_of(noted(plan), plan.store)
    assert (before["state"], before["reason"]) == ("stopped", "interrupted")

    def failing(cell, folder, store):
        raise BsaError("no server answers.")

    monkeypatch.setattr(Calibration, "run", failing)
    ((told,), _) = run_campaign(plan, Here(), Quiet())
    (read,) = rows_of(noted(plan), plan.store)
    assert (told["state"], told["reason"]) == (read["state"], read["reason"]) == ("failed", "no server answers.")


def test_what_a_server_of_ones_own_costs_is_not_known(make_plan):
    plan = make_plan(backends=[{"use": "openai:m", "options": {"base_url": "http://127.0.0.1:1/v1"}}])
    assert {need.cost_usd for need in estimate(plan.cells, plan.store).values()} == {None}
    local = make_plan(store="local", backends=["ollama:m"])
    assert {need.cost_usd for need in estimate(local.cells, local.store).values()} == {0.0}


def test_a_name_that_no_grid_has_is_answered_with_those_that_were_run(finished):
    with pytest.raises(BsaError) as raised:
        tables("toyz", finished.store.root)
    assert raised.value.hint == 'did you mean "toys"?'
    with pytest.raises(BsaError, match="bsa grid main-table runs it"):
        tables("main-table", finished.store.root)


def test_a_campaign_that_is_given_by_its_folder_is_read_from_its_own_store(finished, tmp_path):
    campaign = open_campaign(finished.store.grid("toys"), tmp_path / "another store")
    assert [row["state"] for row in campaign.rows] == ["done"] * 4
