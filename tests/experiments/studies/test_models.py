"""The card of a backend: on the toy cell, and on made-up reports."""

import csv
from pathlib import Path

import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.contracts.effect_choice import effects_of
from bsa.core.errors import BsaError
from bsa.core.files import write_json
from bsa.core.messages import BackendFailure
from bsa.core.scaffold import BUILT_IN
from bsa.experiments.campaign import task_sources
from bsa.experiments.campaign.cell import carry_out
from bsa.experiments.campaign.grid_file import BackendChoice, SuiteFilter
from bsa.experiments.campaign.running import plan_campaign, run_campaign
from bsa.experiments.campaign.store import Store
from bsa.experiments.campaign.task_sources import suite_cases
from bsa.experiments.campaign.trace import Trace
from bsa.experiments.discovery_bench.reports import PACKAGED, Report, places, ranking_cell, read_reports, write_reports
from bsa.experiments.discovery_bench.shortlists import SHORTLISTS
from bsa.experiments.studies.models import CASES, card, models_grid, plan_rankings, write_card
from bsa.experiments.suite.case import SuiteCase
from bsa_toy_cell import HIDDEN, toy_scaffold, toy_task

from ..campaign.conftest import Here, Quiet
from ..discovery_bench.test_grading import answer, write

RULES = BackendChoice(use="rules")
REPORT = Report(
    "case_01",
    "contact-resistance",
    ("contact-resistance", "self-heating", "time-lag"),
    ("self-heating", "contact-resistance"),
    ("After each edge of the current the voltage is 30 mV too low within 0-2 s.",),
)


def test_the_cases_are_twelve_of_the_shipped_suite() -> None:
    assert len(suite_cases(SuiteFilter(suite="generated", cases=list(CASES)))) == len(set(CASES)) == 12


def test_the_packaged_reports_can_be_ranked() -> None:
    reports = read_reports(PACKAGED)
    assert len(reports) == 24
    assert len({report.hidden for report in reports}) > 12
    for report in reports:
        assert report.hidden in {effect.name for effect in effects_of(report.effects)}
        assert report.discrepancy
        assert set(report.by_score) <= set(report.effects)


def test_a_report_is_ranked_with_names_and_without_and_not_asked_again(tmp_path: Path) -> None:
    store = Store(tmp_path)
    cell = ranking_cell(REPORT, RULES, 7)
    report = carry_out(cell, store)
    assert report.state == "done"
    assert {report.result[name] for name in ("replies", "llm_calls", "lost_calls")} == {2, 0}
    assert set(report.result["named"]) <= set(REPORT.effects)
    found = places(REPORT, report.result)
    assert found["by_score"] == 2.0
    assert found["named"] == report.result["named"].index("contact-resistance") + 1
    assert ranking_cell(REPORT, RULES, 8).identity != cell.identity


def test_a_ranking_goes_on_where_the_model_was_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The ranking with names was answered; it is not asked again."""
    cell, store = ranking_cell(REPORT, RULES, 7), Store(tmp_path / "store")
    answer_of, asked = RulesBackend.complete, []

    def lost_once(self, messages, schema, *, seed):
        asked.append(seed)
        if len(asked) == 2:
            raise BackendFailure("nobody there")
        return answer_of(self, messages, schema, seed=seed)

    monkeypatch.setattr(RulesBackend, "complete", lost_once)
    monkeypatch.setattr("bsa.core.run.recording.ASK_AGAIN_AFTER_S", ())
    assert carry_out(cell, store).state == "failed"
    report = carry_out(cell, store)
    assert (report.state, report.reason) == ("done", "")
    assert (len(asked), report.result["llm_calls"], report.result["lost_calls"]) == (3, 3, 1)


@pytest.mark.slow
def test_an_outage_is_no_result(tmp_path: Path) -> None:
    nobody = BackendChoice(use="manual", options={"exchange": str(tmp_path / "x"), "timeout_s": 0.1})
    report = carry_out(ranking_cell(REPORT, nobody, 7), Store(tmp_path / "store"))
    assert report.state == "failed"


def test_reports_are_those_of_single_effects_that_leave_something(tmp_path: Path) -> None:
    answers = {
        "case_01": answer(["contact-resistance"]),
        "case_02": answer(["contact-resistance", "time-lag"], setting="pair"),
        "case_03": answer(["time-lag"]),
    }
    found = {"possible": ["contact-resistance", "time-lag"], "statistics": ["time-lag"], "discrepancy": ["too low"]}
    rows = [{"case": name, "effects": 2, **found} for name in answers]
    rows[2]["discrepancy"] = []
    write(tmp_path, answers, rows, SHORTLISTS)
    write_reports(tmp_path, tmp_path / "reports.json")
    (report,) = read_reports(tmp_path / "reports.json")
    assert report == Report(
        "case_01", "contact-resistance", ("contact-resistance", "time-lag"), ("time-lag",), ("too low",)
    )
    write_json(tmp_path / "other.json", {"reports": [{"name": 3}]})
    with pytest.raises(BsaError, match="discrepancy reports"):
        read_reports(tmp_path / "other.json")


@pytest.mark.slow
def test_a_card_sets_a_backend_beside_rules_and_hybrid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = {"regular-1": SuiteCase("regular", 1, "Chen2020", 1.0, 1.0, HIDDEN)}
    monkeypatch.setattr(task_sources, "load_suite", lambda *arguments, **keywords: cases)
    monkeypatch.setattr(
        "bsa.experiments.suite.build.build_task",
        lambda case, search=None: toy_task(case.hidden, case.key),
    )
    bad = BackendChoice(use="adversarial-advice")
    grid = models_grid(SuiteFilter(suite="generated"), bad, "full", 12, warm_up=3)
    assert [one.warm_up for one in (grid, *grid.include)] == [3, 3, 3]
    assert grid.name == "models-adversarial-advice"
    (first, *_) = plan_campaign(grid, tmp_path / "store").cells
    assert (first.config.backend, first.config.simulations) == ("adversarial-advice", 12)
    grid = grid.model_copy(
        update={
            "scaffolds": [toy_scaffold("full")],
            "include": [
                one.model_copy(update={"scaffolds": [toy_scaffold(name) for name in one.scaffolds or ()]})
                for one in grid.include
            ],
        }
    )
    plan = plan_campaign(grid, tmp_path / "toy")
    rows, _ = run_campaign(plan, Here(), Quiet())
    rankings = plan_rankings([REPORT], bad, 1, tmp_path / "toy", plan.folder / "rankings")
    ranked, _ = run_campaign(rankings, Here(), Quiet())
    found = card(bad.use, "full", 12, rows, ranked, [REPORT], plan.store)
    assert (found["simulations"], found["tasks"], found["reports"]) == (12, 1, 1)
    assert found["rules_pct"] < found["error_pct"]
    assert found["hybrid_pct"] < found["error_pct"]
    assert 0 <= found["valid_pct"] <= 100
    assert found["calls"] >= 10
    text = write_card(found, plan.folder)
    assert "| tasks | 1 |" in text
    with (plan.folder / "card.csv").open() as file:
        assert next(csv.DictReader(file))["backend"] == "adversarial-advice"


def test_a_lost_call_is_no_reply(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of ten calls five gave no reply, and one of the five replies could not be used."""
    monkeypatch.setattr("bsa.experiments.studies.models._unusable", lambda folder: 1)
    monkeypatch.setattr("bsa.experiments.studies.models.trace_of", lambda row, store: Trace())
    row = {"task": "t", "state": "done", "mape": 1.0, "identity": "i", "cost_usd": None}
    row |= {"llm_calls": 10, "lost_calls": 5, "tokens": 1000, "backend_s": 20.0}
    methods = [("full", "m"), ("full", "rules"), ("hybrid", "rules")]
    rows = [{**row, "scaffold": scaffold, "backend": backend} for scaffold, backend in methods]
    (tmp_path / "mine.yaml").write_text((BUILT_IN / "full.yaml").read_text())
    for scaffold in ("full", str(tmp_path / "mine.yaml")):
        assert card("m", scaffold, 20, rows, [], [], Store(tmp_path))["tasks"] == 1
    found = card("m", "full", 20, rows, [], [], Store(tmp_path))
    assert (found["calls"], found["valid_pct"]) == (10, pytest.approx(80.0))
    assert (found["tokens_a_call"], found["seconds_a_call"]) == (200.0, 4.0)
