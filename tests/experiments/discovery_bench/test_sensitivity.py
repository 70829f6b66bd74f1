from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bsa.core.discovery.explanation import Estimate, Explanation
from bsa.core.discovery.findings import Findings, Gap
from bsa.core.discovery.rules import RULES
from bsa.core.effect import Effect, EffectParameter
from bsa.core.files import write_csv
from bsa.core.inference.adequacy import Adequacy
from bsa.core.inference.refit import Refit
from bsa.core.parameters import ParameterSpace
from bsa.experiments.campaign.results import read_table
from bsa.experiments.campaign.text_tables import markdown_table
from bsa.experiments.discovery_bench import sensitivity
from bsa.experiments.discovery_bench.sensitivity import NOT_SEARCHED, sensitivity_table, verdict_by
from bsa.experiments.discovery_case import DiscoverOptions
from bsa.experiments.discovery_journal import opened


def explanation(name, error_mv, p=0.0):
    effect = Effect(name, name, "", (EffectParameter("size", "", 0.0, 0.0, 10.0, 1.0),), "", "")
    errors = 1e-3 * error_mv * np.where(np.arange(80) % 2, 1.0, -1.0)
    fit = Refit(ParameterSpace(effect.searched), np.zeros(1), errors / 1e-3, np.ones((80, 1)), True)
    v = 1e-3 * error_mv
    found = Explanation((effect,), fit, Adequacy(p, p, 1.0), v, v, errors, np.full(80, 1e-3))
    found.estimates = {effect.key: (Estimate("size", "", 1.0, (0.9, 1.1), 0.0, False),)}
    return found


def found(left_mv, p=0.0):
    base = explanation("base", 10.0, p)
    gap = Gap(base, base, 1e-3, 1e-3)
    return RULES.decide(gap, [explanation("heat", left_mv)])


@pytest.mark.parametrize(("left_mv", "half"), [(4.0, "unexplained"), (1.5, "effect-found")])
def test_a_constant_changes_the_verdicts_that_lie_near_it(left_mv, half):
    findings = found(left_mv)
    for factor, verdict in ((0.5, half), (2.0, "effect-found")):
        rules = replace(RULES, left_over=factor * RULES.left_over)
        assert verdict_by(rules, findings)["verdict"] == verdict


def test_the_journals_of_the_cases_are_read_and_not_written(tmp_path, monkeypatch):
    (tmp_path / "record.csv").write_text("1")
    options = DiscoverOptions(data=[tmp_path / "record.csv"], parameters="Chen2020", out=tmp_path / "case")
    with opened(options):
        pass
    before = (tmp_path / "case" / "journal.jsonl").read_bytes()
    findings = found(4.0)

    class Simulated:
        at_once, has_low_fidelity, refused = 1, False, {}

        def predict(self, requests):
            return [None for _ in requests]

    def set_up(case, options, make_simulator, journal):
        def run():
            make_simulator(None, None, None).predict([SimpleNamespace(identity={"asked": "now"})])
            return findings

        return SimpleNamespace(engine=lambda: SimpleNamespace(run=run))

    monkeypatch.setattr(sensitivity, "read_case", lambda options: None)
    monkeypatch.setattr(sensitivity, "in_this_process", lambda *_: Simulated())
    monkeypatch.setattr(sensitivity, "set_up", set_up)
    assert sensitivity._replayed(tmp_path / "case") is findings
    assert (tmp_path / "case" / "journal.jsonl").read_bytes() == before


def test_what_was_not_searched_is_said():
    findings = found(9.5, p=0.008)
    assert verdict_by(RULES, findings)["verdict"] == "no-missing-effect"
    nothing = Findings("no-missing-effect", findings.gap, findings.base)
    assert verdict_by(replace(RULES, false_alarm=0.02), nothing)["verdict"] == NOT_SEARCHED


def test_the_table_tells_which_cases_change(tmp_path):
    def row(task, constant, factor, verdict, named, grade):
        values = task, constant, factor, verdict, named, grade
        return dict(zip(("task", "constant", "factor", "verdict", "named", "grade"), values, strict=True))

    rows = [row("case_1", "", 1.0, "effect-found", "heat", "right"), row("case_2", "", 1.0, "unexplained", "", "right")]
    rows = [{**known, "value": float("nan")} for known in rows]
    for constant, value in (("clear_bic", 10.0), ("of_an_earlier_version", 0.25)):
        for factor in (0.5, 2.0):
            rows += [{**known, "constant": constant, "factor": factor, "value": factor * value} for known in rows[:2]]
    rows[-2] |= {"verdict": "unexplained", "named": "", "grade": "declined"}
    expected = markdown_table(
        ["constant", "value", "half (2 cases)", "twice"],
        [
            ["`clear_bic`", "10", "all the same", "all the same"],
            ["`of_an_earlier_version`", "0.25", "all the same", "case_1: heat, right → unexplained, declined"],
        ],
        4,
    )
    assert sensitivity_table(rows) == expected
    write_csv(tmp_path / "rows.csv", rows)
    assert sensitivity_table(read_table(tmp_path / "rows.csv")) == expected
