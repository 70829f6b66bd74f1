"""A blind case whose language model could not be had has no result, and is run again."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest
from bsa.core.discovery.ranking import Ranking
from bsa.core.errors import BsaError
from bsa.experiments.campaign.cell import carry_out
from bsa.experiments.discovery_bench import blind_cell, shortlists
from bsa.experiments.discovery_bench.blind_cell import plan_cases

LOST = Ranking((), note="nothing listens", lost=True)


@pytest.fixture
def cases(tmp_path: Path) -> Path:
    """A folder of two blind cases without their records' physics."""
    for name in ("case_01", "case_02"):
        (tmp_path / name).mkdir()
        records = [{"file": "slow.csv", "ambient_c": 25.0}, {"file": "holdout.csv", "ambient_c": 25.0}]
        content = {"parameters": "Chen2020", "model": "SPMe", "records": records}
        (tmp_path / name / "case.json").write_text(json.dumps(content))
        for record in records:
            (tmp_path / name / record["file"]).write_text(f"{name} {record['file']}")
    return tmp_path


@pytest.mark.parametrize("kind", ["discovery", "shortlist"])
def test_an_outage_is_a_failed_cell(kind, cases: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nomination = SimpleNamespace(lacks=(), gain=1.0, effect=SimpleNamespace(key="heat"))
    known = SimpleNamespace(nominations=[nomination], refitted=None)
    bench = SimpleNamespace(
        engine=lambda: SimpleNamespace(shortlist=lambda: known),
        discrepancy=lambda refitted: ["28 mV too high"],
    )
    monkeypatch.setattr(shortlists, "read_case", lambda options: None)
    monkeypatch.setattr(shortlists, "set_up", lambda case, options: bench)
    monkeypatch.setattr(shortlists, "backend_or_none", lambda options: nullcontext(object()))
    monkeypatch.setattr(shortlists, "ask", lambda *_: LOST)
    monkeypatch.setattr(blind_cell, "discover", lambda options: SimpleNamespace(ranking=LOST))
    plan = plan_cases(cases, "mine", kind)
    report = carry_out(plan.cells[0], plan.store)
    assert (report.state, report.reason) == ("failed", "nothing listens")
    assert plan.store.result(report.identity) is None


def test_a_cell_is_keyed_by_records_options_and_kind(cases: Path) -> None:
    def identities(**asked) -> list[str]:
        return [cell.identity for cell in plan_cases(cases, "mine", **{"kind": "discovery", **asked}).cells]

    known = identities()
    assert identities() == known
    assert identities(backend="rules", backend_options={"timeout_s": 5}) == identities(backend="rules")
    others = [*identities(kind="shortlist"), *identities(hide_names=True), *identities(backend="rules")]
    (cases / "case_01" / "slow.csv").write_text("another record")
    others += identities()[:1]
    assert len({*known, *others}) == 9


def test_only_the_named_cases_are_run(cases: Path) -> None:
    plan = plan_cases(cases, "mine", "discovery", ["case_02"])
    assert [cell.axes.task for cell in plan.chosen] == ["case_02"]
    assert len(plan.cells) == 2
    with pytest.raises(BsaError, match='has no case "case_07"'):
        plan_cases(cases, "mine", "discovery", ["case_07"])
    with pytest.raises(BsaError, match="is no name of results"):
        plan_cases(cases, "../mine", "discovery")
    with pytest.raises(BsaError, match="holds no blind case"):
        plan_cases(cases / "case_01", "mine", "discovery")
