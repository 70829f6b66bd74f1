import base64
import json
import zlib

import pytest
from bsa.experiments.discovery_bench.making import SEALED
from bsa.experiments.discovery_bench.scoring import as_markdown, case_table, mark_cases

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
    assert "nothing hidden: a name was given in 1 of 2 cases" in text
    assert "strong: the right name in 1 of 1 cases (100%)" in text
    assert "| nothing | none | contact-resistance (1); no-missing-effect (1) |" in text
    assert "| case_02 | none | nothing | effect-found | contact-resistance | wrong |" in case_table(
        mark_cases(tmp_path)
    )


def write(folder, answers, rows):
    (folder / SEALED).write_bytes(base64.b64encode(zlib.compress(json.dumps(answers).encode())))
    (folder / "results.jsonl").write_text("\n".join(json.dumps(r) for r in rows) + "\n")
