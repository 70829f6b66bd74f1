import base64
import json
import math
import zlib
from types import SimpleNamespace

import numpy as np
import pytest
from bsa.core.discovery.findings import Nomination
from bsa.core.discovery.score import Score
from bsa.core.effect import Effect, EffectParameter
from bsa.core.errors import BsaError
from bsa.core.files import write_csv, write_json
from bsa.experiments.campaign.results import read_table
from bsa.experiments.discovery_bench import shortlists
from bsa.experiments.discovery_bench.grading import grade_cases, graded_of, graded_row
from bsa.experiments.discovery_bench.making import SEALED
from bsa.experiments.discovery_bench.shortlists import SHORTLISTS, shortlist, shortlist_places, shortlist_table
from bsa.experiments.discovery_bench.tables import as_markdown, case_table

STRENGTH = {"contact-resistance": ["contact-resistance: resistance [Ohm]", 0.02]}


def answer(effects=(), outside="", setting="strong", model="SPMe", chi2=300.0):
    return {
        "names": list(effects),
        "keys": list(effects),
        "strengths": STRENGTH,
        "outside": outside,
        "setting": setting,
        "model": model,
        "truth_chi2": chi2,
        "averages": 300,
        "shifts": {},
    }


def row(case, verdict, names=(), rivals=(), value=0.021, base_chi2=900.0, interval=(0.0195, 0.0225)):
    parameter = {"name": "resistance", "unit": "Ohm", "null": 0.0, "value": value, "ci95": interval}
    effects = [{"name": "contact-resistance", "parameters": [parameter]}] if names else []
    gap = {"closed": 0.97, "holdout_closed": 0.95}
    return {
        "case": case,
        "verdict": verdict,
        "names": list(names),
        "rivals": [list(r) for r in rivals],
        "effects": effects,
        "gap": gap,
        "base_chi2": base_chi2,
        "wall_s": 100.0,
        "cpu_s": 60.0,
        "simulations": 500,
    }


R, H = "contact-resistance", "self-heating"


@pytest.mark.parametrize(
    ("said", "hidden", "grade"),
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
def test_grades(tmp_path, said, hidden, grade):
    write(tmp_path, {"case_01": hidden}, [row("case_01", *said)])
    (graded,) = grade_cases(tmp_path, "discovery")
    assert graded.grade == grade
    assert graded.parameter_error == (pytest.approx(0.05) if grade == "right" and graded.named else None)


def test_the_tables_count_names_given_to_nothing(tmp_path):
    answers = {"case_01": answer([R]), "case_02": answer(setting="none"), "case_03": answer(setting="none")}
    rows = [
        row("case_01", "effect-found", [R]),
        row("case_02", "effect-found", [R]),
        row("case_03", "no-missing-effect"),
    ]
    write(tmp_path, answers, rows)
    text = as_markdown(grade_cases(tmp_path, "discovery"))
    assert "nothing hidden: a name was given in 1 of 2 cases (exact 95 % interval 1.3 to 99 %)" in text
    assert "strong: the right name in 1 of 1 cases; in 1 of 1 without those declared ambiguous" in text
    assert "| nothing | none | contact-resistance (1); no-missing-effect (1) |" in text
    assert "| case_02 | none | nothing | effect-found | contact-resistance | wrong |" in case_table(
        grade_cases(tmp_path, "discovery")
    )


def test_what_is_detectable_is_settled_by_the_truth_and_not_by_what_was_said(tmp_path):
    answers = {
        f"case_{k}": answer([R], setting="single", model=model) for k, model in enumerate(("SPMe", "SPMe", "DFN"))
    }
    rows = [
        row("case_0", "effect-found", [R]),
        row("case_1", "no-missing-effect", base_chi2=311.0),  # 11 for a strength that costs ln 300: odds of e^2.6
        row("case_2", "unexplained", base_chi2=320.0),
    ]
    write(tmp_path, answers, rows)
    graded = grade_cases(tmp_path, "discovery")
    assert [case.detectable for case in graded] == [True, False, True]
    assert graded[0].evidence == pytest.approx(0.5 * (600.0 - np.log(300)))
    text = as_markdown(graded)
    assert "all models: 2 of 3 hidden effects are detectable" in text
    assert "the right name is given in 1 of 2 cases" in text
    assert "DFN: 1 of 1 hidden effects are detectable" in text


def test_an_interval_is_right_if_it_holds_the_truth(tmp_path):
    rows = [
        row("case_0", "effect-found", [R]),
        row("case_1", "effect-found", [R], interval=(0.0205, 0.0225)),
        row("case_2", "unexplained", interval=(0.0205, 0.0225)),
    ]
    write(tmp_path, {r["case"]: answer([R], setting="single") for r in rows}, rows)
    graded = grade_cases(tmp_path, "discovery")
    assert [case.covered for case in graded] == [1.0, 0.0, None]
    assert "inside their 95 % intervals, where the name is right: 1 of 2 cases" in as_markdown(graded)


def test_another_variant_of_the_effect_has_no_true_strength(tmp_path):
    said = row("case_0", "effect-found", [R])
    said["effects"][0]["variant"] = "positive electrode"
    write(tmp_path, {"case_0": answer([R], setting="single")}, [said])
    (graded,) = grade_cases(tmp_path, "discovery")
    assert (graded.grade, graded.parameter_error, graded.covered) == ("right", None, None)


def test_weak_cases_have_three_denominators(tmp_path):
    verdicts = [("effect-found", [R]), ("ambiguous", [R]), ("no-missing-effect", []), ("unexplained", [])]
    rows = [row(f"case_0{place}", *said) for place, said in enumerate(verdicts)]
    write(tmp_path, {r["case"]: answer([R], setting="weak") for r in rows}, rows)
    assert (
        "* weak: the right name in 1 of 4 cases; in 1 of 3 without those declared ambiguous; "
        "in 1 of 2 without those, too, whose base model leaves noise only."
        in as_markdown(grade_cases(tmp_path, "discovery"))
    )


def test_a_case_that_failed_has_given_no_wrong_name(tmp_path):
    rows = [row("case_0", "effect-found", [R]), row("case_1", "failed"), row("case_2", "failed")]
    write(tmp_path, {r["case"]: answer(setting="none") for r in rows}, rows)
    text = as_markdown(grade_cases(tmp_path, "discovery"))
    assert "wrong names in all: 1 of 1 cases" in text
    assert "nothing hidden: a name was given in 1 of 1 cases" in text
    assert "`no-missing-effect` in 0 of 1 cases" in text
    assert "| none | 3 | 0 | 0 | 0 | 0 | 1 | 2 |" in text


def test_where_there_was_no_gap_there_is_no_share_of_it(tmp_path):
    rows = [row("case_0", "effect-found", [R]), row("case_1", "effect-found", [R])]
    rows[1]["gap"] = {"closed": None, "holdout_closed": None}
    write(tmp_path, {r["case"]: answer([R]) for r in rows}, rows)
    graded = grade_cases(tmp_path, "discovery")
    assert "gap closed on held-out data where the name is right: median 0.950" in as_markdown(graded)
    assert "(1 cases)" in as_markdown(graded)
    line = case_table(graded).splitlines()[-1]
    assert line.startswith("| case_1 | strong | contact-resistance | effect-found | contact-resistance | right |  |  |")


def test_graded_cases_survive_a_file(tmp_path):
    gain = {**answer(["current-gain"]), "strengths": {"current-gain": ["current-gain: gain", 0.97]}}
    answers = {"case_01": answer([R, H], setting="pair"), "case_02": answer(setting="none"), "case_03": gain}
    found = [row("case_01", "effect-found", [R, H]), row("case_02", "no-missing-effect"), row("case_03", "unexplained")]
    write(tmp_path, answers, found)
    graded = grade_cases(tmp_path, "discovery")
    write_csv(tmp_path / "cases.csv", [graded_row(case) for case in graded])
    assert [graded_of(found) for found in read_table(tmp_path / "cases.csv")] == graded


def test_a_shortlist_counts_places():
    found = {"a": 1.0, "b": math.inf}
    places = [{"case": case, "ranked_by": "score test", "place": place} for case, place in found.items()]
    assert "| score test | 2 | 1 | 1 | 1 |" in shortlist_table(places)


def test_a_shortlist_is_graded_by_the_place_of_what_was_hidden(tmp_path):
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


def test_a_backend_ranks_the_effects_of_a_case_with_names_and_without(monkeypatch):
    effects = [
        Effect(name, name, "", (EffectParameter("size", "V", 0.0, 0.0, 1.0, 0.01),), signature, "")
        for name, signature in ((R, "grows with the rate"), (H, "relaxes over minutes of a rest"), ("leak", "a drive"))
    ]
    nominations = [Nomination(e, score=Score(1.0, 3.0, gain)) for e, gain in zip(effects, (9.0, 4.0, 0.0), strict=True)]
    known = SimpleNamespace(nominations=nominations, refitted=None)
    bench = SimpleNamespace(
        engine=lambda: SimpleNamespace(shortlist=lambda: known),
        discrepancy=lambda refitted: ["measured voltage lies 9 mV below the model during rest after a discharge"],
    )

    def options(backend=None):
        return SimpleNamespace(seed=1, backend=backend, backend_options={})

    monkeypatch.setattr(shortlists, "read_case", lambda options: None)
    monkeypatch.setattr(shortlists, "set_up", lambda case, options: bench)
    found = shortlist(options("rules"))
    assert found["statistics"] == [R, H]
    # The rules backend reads signatures: a name says nothing to it.
    assert found["named"][0] == found["nameless"][0] == H
    assert shortlist(options()).keys() == {"effects", "statistics", "possible", "discrepancy", "summary"}


def write(folder, answers, rows, name="discovery"):
    """A campaign on blind cases that has found the rows."""
    (folder / SEALED).write_bytes(base64.b64encode(zlib.compress(json.dumps({"seed": 1, "answers": answers}).encode())))
    cells = []
    for row in rows:
        content = {key: value for key, value in row.items() if key != "case"}
        if row.get("verdict") == "failed":
            write_json(folder / "cells" / row["case"] / "failure.json", {"reason": "broken"})
        else:
            result = {"status": "finished", "best": {}, "initial": {}, **content}
            write_json(folder / "cells" / row["case"] / "result.json", result)
        axes = dict.fromkeys(("mode", "chemistry", "rates", "scaffold", "backend", "method", "trouble"), "")
        cells.append({"identity": row["case"], "task": row["case"], "seed": 0, **axes})
    write_json(folder / "grids" / name / "grid.json", {"grid": {"name": name}, "cells": cells, "methods": [""]})


def test_a_case_that_failed_is_graded_so_and_one_that_was_not_run_is_left_out(tmp_path):
    write(tmp_path, {"case_01": answer([R])}, [row("case_01", "failed")])
    (graded,) = grade_cases(tmp_path, "discovery")
    assert (graded.grade, graded.named) == ("failed", ())
    (tmp_path / "cells" / "case_01" / "failure.json").unlink()
    assert grade_cases(tmp_path, "discovery") == []


def test_answers_and_results_of_different_cases_are_refused(tmp_path):
    write(tmp_path, {"case_02": answer([R])}, [row("case_01", "effect-found", [R])])
    with pytest.raises(BsaError, match="case that it has not: 'case_01'"):
        grade_cases(tmp_path, "discovery")


@pytest.mark.parametrize(
    ("shifts", "error"),
    [
        ({}, 0.25),
        ({"Negative particle radius [m]": 0.8, "Positive particle radius [m]": 0.8}, 0.0),
        ({"Negative particle radius [m]": 0.8}, None),
        ({"Negative electrode active material volume fraction": 0.8}, 0.25),
    ],
)
def test_a_strength_on_the_particles_surface_is_compared_at_the_sets_own_radii(tmp_path, shifts, error):
    name, words = "double-layer-capacitance", "double-layer-capacitance: capacitance [F.m-2]"
    hidden = answer([name], setting="single") | {"strengths": {name: [words, 20.0]}, "shifts": shifts}
    found = row("case_01", "effect-found", [name])
    parameter = {"name": "capacitance", "unit": "F.m-2", "null": 0.0, "value": 25.0, "ci95": (24.0, 26.0)}
    found["effects"] = [{"name": name, "parameters": [parameter]}]
    write(tmp_path, {"case_01": hidden}, [found])
    (graded,) = grade_cases(tmp_path, "discovery")
    assert graded.parameter_error == (error if error is None else pytest.approx(error))
    assert graded.covered == (None if error is None else float(error == 0.0))
