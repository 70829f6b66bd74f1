import base64
import json
import zlib
from types import SimpleNamespace

import pytest
from bsa.core.discovery.findings import Nomination
from bsa.core.discovery.score import Score
from bsa.core.effect import Effect, EffectParameter
from bsa.core.files import write_csv
from bsa.experiments.campaign.results import read_table
from bsa.experiments.discovery_bench import shortlists
from bsa.experiments.discovery_bench.making import SEALED
from bsa.experiments.discovery_bench.scoring import as_markdown, case_table, mark_cases, marked_of, marked_row
from bsa.experiments.discovery_bench.shortlists import SHORTLISTS, shortlist_case, shortlist_places, shortlist_table

STRENGTH = {"contact-resistance: resistance [Ohm]": 0.02}


def answer(effects=(), outside="", setting="strong"):
    return {"effects": list(effects), "strengths": STRENGTH, "outside": outside, "setting": setting}


def row(case, verdict, names=(), rivals=(), value=0.021):
    parameter = {"name": "resistance", "unit": "Ohm", "null": 0.0, "value": value}
    effects = [{"name": "contact-resistance", "parameters": [parameter]}] if names else []
    gap = {"closed": 0.97, "holdout_closed": 0.95}
    return {
        "case": case,
        "verdict": verdict,
        "names": list(names),
        "rivals": [list(r) for r in rivals],
        "effects": effects,
        "gap": gap,
        "wall_s": 100.0,
        "cpu_s": 60.0,
        "simulations": 500,
    }


R, H = "contact-resistance", "self-heating"


@pytest.mark.parametrize(
    ("said", "hidden", "mark"),
    [
        (("effect-found", [R]), answer([R]), "right"),
        (("effect-found", [H]), answer([R]), "wrong"),
        (("ambiguous", [H], [[R]]), answer([R]), "ambiguous"),
        (("ambiguous", [H], [["time-lag"]]), answer([R]), "wrong"),
        (("unexplained", []), answer([R]), "declined"),
        (("effect-found", [R]), answer([R, H], setting="pair"), "partial"),
        (("effect-found", [R]), answer(setting="none"), "wrong"),
        (("no-missing-effect", []), answer(setting="none"), "right"),
        (("unexplained", []), answer(outside="slow-memory", setting="outside"), "right"),
        (("effect-found", [R]), answer(outside="slow-memory", setting="outside"), "wrong"),
    ],
)
def test_marks(tmp_path, said, hidden, mark):
    write(tmp_path, {"case_01": hidden}, [row("case_01", *said)])
    (marked,) = mark_cases(tmp_path)
    assert marked.mark == mark
    assert marked.parameter_error == (pytest.approx(0.05) if mark == "right" and marked.named else None)


def test_the_tables_count_names_given_to_nothing(tmp_path):
    answers = {"case_01": answer([R]), "case_02": answer(setting="none"), "case_03": answer(setting="none")}
    rows = [
        row("case_01", "effect-found", [R]),
        row("case_02", "effect-found", [R]),
        row("case_03", "no-missing-effect"),
    ]
    write(tmp_path, answers, rows)
    text = as_markdown(mark_cases(tmp_path))
    assert "nothing hidden: a name was given in 1 of 2 cases (exact 95 % interval 1.3 to 99 %)" in text
    assert "strong: the right name in 1 of 1 cases; in 1 of 1 without those declared ambiguous" in text
    assert "| nothing | none | contact-resistance (1); no-missing-effect (1) |" in text
    assert "| case_02 | none | nothing | effect-found | contact-resistance | wrong |" in case_table(
        mark_cases(tmp_path)
    )


def test_weak_cases_have_three_denominators(tmp_path):
    verdicts = [("effect-found", [R]), ("ambiguous", [R]), ("no-missing-effect", []), ("unexplained", [])]
    rows = [row(f"case_0{place}", *said) for place, said in enumerate(verdicts)]
    write(tmp_path, {r["case"]: answer([R], setting="weak") for r in rows}, rows)
    assert (
        "* weak: the right name in 1 of 4 cases; in 1 of 3 without those declared ambiguous; "
        "in 1 of 2 without those, too, whose base model leaves noise only." in as_markdown(mark_cases(tmp_path))
    )


def test_marked_cases_survive_a_file(tmp_path):
    answers = {"case_01": answer([R, H], setting="pair"), "case_02": answer(setting="none")}
    write(tmp_path, answers, [row("case_01", "effect-found", [R, H]), row("case_02", "no-missing-effect")])
    marked = mark_cases(tmp_path)
    write_csv(tmp_path / "cases.csv", [marked_row(case) for case in marked])
    assert [marked_of(found) for found in read_table(tmp_path / "cases.csv")] == marked


def test_a_shortlist_is_marked_by_the_place_of_what_was_hidden(tmp_path):
    answers = {
        "case_01": answer([R]),
        "case_02": answer([H]),
        "case_03": answer([R, H], setting="pair"),
        "case_04": answer([R]),
    }
    rows = [
        {"case": "case_01", "effects": 9, "statistics": [R, H], "named": [H, "time-lag (a)", "time-lag (b)", R]},
        {"case": "case_02", "effects": 9, "statistics": ["a", "b", "c", H], "named": []},
        {"case": "case_03", "effects": 9, "statistics": [R], "named": [R]},
        {"case": "case_04", "effects": 0, "statistics": []},
    ]
    write(tmp_path, answers, rows, SHORTLISTS)
    text = shortlist_table(shortlist_places(tmp_path))
    assert "| score test | 2 | 1 | 1 | 2 |" in text
    assert "| backend, effects with their names | 2 | 0 | 1 | 1 |" in text
    assert "meaning" not in text


def test_a_backend_ranks_the_effects_of_a_case_with_names_and_without(tmp_path, monkeypatch):
    effects = [
        Effect(name, name, "", (EffectParameter("size", "V", 0.0, 0.0, 1.0, 0.01),), signature, "")
        for name, signature in ((R, "grows with the rate"), (H, "relaxes over minutes of a rest"), ("leak", "a drive"))
    ]
    nominations = [
        Nomination(e, score=Score(1.0, 3.0, gain, 1.0)) for e, gain in zip(effects, (9.0, 4.0, 0.0), strict=True)
    ]
    known = SimpleNamespace(nominations=nominations, refitted=None)
    bench = SimpleNamespace(
        engine=lambda settings: SimpleNamespace(shortlist=lambda: known),
        discrepancy=lambda refitted: ["measured voltage lies 9 mV below the model during rest after a discharge"],
    )

    def options_of(folder, backend=None):
        return SimpleNamespace(settings=None, seed=1, backend=backend, backend_options={})

    monkeypatch.setattr(shortlists, "options_of", options_of)
    monkeypatch.setattr(shortlists, "read_case", lambda options: None)
    monkeypatch.setattr(shortlists, "set_up", lambda case, options: bench)
    found = shortlist_case(tmp_path / "case_01", backend="rules")
    assert found["statistics"] == [R, H]
    # The rules backend reads signatures: a name says nothing to it.
    assert found["named"][0] == found["nameless"][0] == H
    assert shortlist_case(tmp_path / "case_01").keys() == {"case", "effects", "statistics", "summary"}


def write(folder, answers, rows, results="results.jsonl"):
    (folder / SEALED).write_bytes(base64.b64encode(zlib.compress(json.dumps(answers).encode())))
    (folder / results).write_text("\n".join(json.dumps(r) for r in rows) + "\n")
