"""The documentation's tables, on rows small enough to reckon by hand."""

import math

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.files import write_csv
from bsa.experiments.campaign.summary import exact_interval, paper_rows
from bsa.experiments.campaign.text_tables import brief, spread
from doc_tables.catalogue import TABLES
from doc_tables.results import Results


def suite_row(case, method="hybrid", mape=1.0, mode="regular", parameter_set="Chen2020", **more):
    row = {"case": case, "mode": mode, "parameter_set": parameter_set, "rates": "1C/2C", "method": method, "mape": mape}
    times = {"wall_s": 10.0, "proposer_s": 2.0}
    return {**row, "initial_mape": 50.0, "early_mape": 5.0, "simulations": 60, "failed_simulations": 1, **times, **more}


def verdict(case, adviser, alone, advised):
    worse = {"no_worse": advised <= alone, "score_no_worse": True}
    errors = {"alone": alone, "advised": advised, "alone_score": alone, "advised_score": advised}
    return {"task": case, "chemistry": "Chen2020", "rates": "1C/1C", "adviser": adviser, **errors, **worse}


@pytest.fixture
def made(tmp_path):
    """Makes a table of rows by the name of their file."""

    def make(name, **studies):
        for study, rows in studies.items():
            write_csv(tmp_path / f"{study}.csv", rows)
        lines = [f"{study}: {{command: c, version: v, machine: m}}" for study in studies]
        (tmp_path / "origins.yaml").write_text("\n".join(lines))
        return TABLES[name](Results(tmp_path))

    return make


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.00123, "0.0012"), (3.44, "3.4"), (12.34, "12.3"), (123.4, "123"), (math.nan, "–")],
)
def test_numbers_have_two_or_three_digits(value, text):
    assert brief(value) == text


def test_a_spread_is_the_sample_standard_deviation():
    values = [1.0, 2.0, 6.0]
    assert spread(values) == f"3 ± {np.std(values, ddof=1):.2g}"
    assert spread([1.0]) == "1"
    assert spread([1.0, 3.0, math.nan]) == "2 ± 1.4 (1 without result)"


@pytest.mark.parametrize("cases", [4, 8, 55])
def test_the_exact_bound_of_no_event_is_known_in_closed_form(cases):
    upper = 100 * (1 - 0.025 ** (1 / cases))
    assert exact_interval(0, cases) == f"exact 95 % interval 0 to {upper:.2g} %"


def test_a_cell_is_bold_where_it_is_below_the_papers_best_row(made):
    best = min(row["Chen2020"].mean for row in paper_rows()["regular"].values())
    text = made("published", published=[suite_row("regular-1", mape=best - 1), suite_row("regular-2", mape=best - 2)])
    assert f"| hybrid | **{brief(best - 1.5)} ± 0.71** |" in text
    above = made("published", published=[suite_row("regular-1", mape=best + 1)])
    assert f"| hybrid | {brief(best + 1)} |" in above


def test_the_start_is_compared_with_the_papers_default_row(made):
    paper = paper_rows()["regular"]["paper Default"]
    near, far = paper["Chen2020"].mean * 1.001, paper["Prada2013"].mean * 1.1
    rows = [suite_row("regular-1", initial_mape=near)]
    rows += [suite_row("regular-2", parameter_set="Prada2013", initial_mape=far)]
    text = made("published-start", published=rows)
    assert "within 0.3 % in 1 of 2 cells" in text
    assert "+10.0 %" in text


def test_what_had_another_budget_is_named(made):
    rows = [suite_row("regular-1", parameter_set="ORegan2022", simulations=count) for count in (50, 88)]
    rows += [suite_row("extreme-1", mode="extreme", parameter_set="ORegan2022", simulations=50)]
    assert "Tasks with more than 50 simulations: regular-1 88." in made("published-oregan", published=rows)


def test_baselines_are_compared_on_shared_tasks(made):
    published = [suite_row(f"regular-{n}", mape=0.1) for n in (1, 2, 3)]
    others = [
        suite_row(f"regular-{n}", method, 2.0 * n) for n in (1, 2) for method in ("least-squares", "bo", "cma-es", "de")
    ]
    text = made("baselines", published=published, baselines=[*others, suite_row("regular-1", "qnehvi", 7.0)])
    assert "| hybrid | 0.1 ± 0 | 0.1 | 0.1 | 5 |" in text
    assert "| bo | 3 ± 1.4 | 3 | 4 | 5 |" in text
    assert "over 2 tasks: 20.0" in text
    assert "The 1 tasks on which qNEHVI" in text


def test_a_harm_is_counted_named_and_bounded(made):
    text = made("no-harm", no_harm=[verdict("a", "rules", 1.0, 0.5), verdict("b", "rules", 1.0, 1.5)])
    assert f"| rules | 2 | 1 | 1 | 0.5 | {exact_interval(1, 2)} |" in text
    assert "Worse than least squares: b with rules (1.5 and 1 %)." in text


def test_an_ablation_is_paired_by_case(made):
    rows = [
        {"task": f"t{case}", "method": method, "mape": factor * (1 + case)}
        for case in range(8)
        for method, factor in (("full", 1.0), ("no-memory", 4.0))
    ]
    assert "| no-memory | **4** | 4 to 4 | 8 / 0 / 8 | 0.0078 | larger error |" in made("ablation", ablation=rows)


def test_noise_random_and_time(made):
    noisy = made("noise", published=[suite_row("a", mape=0.1)], noise=[suite_row("a", mape=0.3)])
    assert "| with noise, 60 simulations | 0.3 |" in noisy
    assert "| without, 100 simulations | 0.1 |" in noisy
    drawn = made("random", random=[suite_row("random-0", mape=1.0), suite_row("random-1", mape=3.0)])
    assert "2 cases of 1 base cells: mean 2 %, median 2 %, worst 3 %; the starts have 50.0 to 50.0 %." in drawn
    assert "Above 1 %: random-1 (Chen2020 1C/2C, 3 %)." in drawn
    costs = {
        "solver_s": 0.2,
        "evaluation_s": 0.2,
        "worker_s": 0.22,
        "rebuild_s": 2.0,
        "two_workers": 1.8,
        "loop_s": 0.01,
    }
    assert "| building the model for every evaluation | 10.0 |" in made(
        "evaluation", evaluation=[{**costs, "repeats": 15}]
    )


def test_recovery_is_compared_with_a_truth_known_to_five_percent(made):
    within = {"pearson": 0.5, "spearman": 0.4, "share_of_steps_that_co_decrease": 0.6, "largest_relative_error": 0.3}
    rows = [{"case": "a", "method": "hybrid", "mape": 0.2, "median_relative_error": 0.01, **within}]
    held = [
        {"case": "a", "method": "hybrid", "rate": 1.0, "quality": quality, "mape": mape}
        for quality, mape in (("perfect", 0.0), ("5 % noise", 10.0), ("recovered", 0.1), ("default", 90.0))
    ]
    text = made("recovery", recovery=rows, held_out=held)
    assert "100 to 100 times better than the truth known to 5 %" in text
    assert "At the rates that were fitted: mean 0.2 %." in text


def test_costs_of_a_cell_are_reckoned_up(made):
    values = {"run": 36.0, "overhead": 6.0, "files": 6.0, "bytes": 0.5, "lines": 72.0, "tokens": 1000.0, "prompt": 90.0}
    rows = [{"name": name, "figure": name, "value": value, "unit": "u"} for name, value in values.items()]
    assert "| run | 36.0 u |" in made("grid-cost", grid_cost=rows)
    text = made("grid-scaling", grid_cost=rows)
    assert "1000 core hours" in text
    assert "800 a second" in text


def test_measured_cells_show_what_was_named_and_how_far_the_gap_went(made):
    row = {"cell": "x", "verdict": "effect-found", "named": "contact-resistance", "unit": "mohm", "cpu_s": 90.0}
    errors = {"fitted_before_mv": 81, "fitted_after_mv": 40, "held_out_before_mv": 66, "held_out_after_mv": 29}
    text = made("measured-cells", measured_cells=[{**row, **errors, "value": 52.3, "low": 32.0, "high": 73.0}])
    assert "| contact-resistance | 52.3 mohm (32.0 to 73.0) | 81.0 → 40.0 | 66.0 → 29.0 | 90 |" in text


def blind(task, setting, hidden, verdict, named, grade, **more):
    shares = {"closed": 1.0, "held_closed": 1.0, "parameter_error": 0.05, "covered": 1.0, "evidence": 100.0}
    cost = {"wall_s": 60.0, "cpu_s": 50.0, "simulations": 900, "model": "SPMe"}
    said = {"verdict": verdict, "named": named, "grade": grade}
    return {"task": task, "setting": setting, "hidden": hidden, **said, **shares, **cost, **more}


BLIND = [
    blind("20261123 case_001", "single", "self-heating", "effect-found", "self-heating", "right"),
    blind("20261123 case_002", "single", "sei-growth", "effect-found", "lithium-plating", "wrong"),
    blind("20269999 case_001", "none", "", "no-missing-effect", "", "right", evidence=math.nan),
]


def test_a_further_seed_has_a_line_with_its_version(made, tmp_path):
    versions = '{"20261123": abc1234, "20269999": "def5678 (from case 1)"}'
    with pytest.raises(BsaError, match="does not say which version ran seed 20261123, 20269999"):
        made("discovery-blind", discovery_blind=BLIND)
    (tmp_path / "origins.yaml").write_text(f"discovery_blind: {{command: c, version: {versions}, machine: m}}")
    text = TABLES["discovery-blind"](Results(tmp_path))
    assert "| 20261123 | abc1234 | 2 | 1 | 0 | 0 | 0 | 1 | 1 of 2 |" in text
    assert "| 20269999 | def5678 (from case 1) | 1 | 1 | 0 | 0 | 0 | 0 | – |" in text
    assert "| from 20261201 on |  | 1 | 1 | 0 | 0 | 0 | 0 | – |" in text
    assert "made by the versions that the table gives; m" in text
    assert "| sei-growth | lithium-plating (1) |" in text


def test_sets_of_cases_are_summed_up_and_their_aims_counted(made):
    cell = {"cell": "cell", "strength": "1 V", "left_mv": 2.0, "known_mv": 0.0}
    single = {**cell, **blind("case_001", "single", "time-lag", "effect-found", "time-lag", "right")}
    null = {**cell, **blind("case_002", "none", "", "no-missing-effect", "", "right")}
    rows = [{**single, "beside": "a"}, {**null, "beside": "a"}, {**single, "beside": "a and b"}]
    rows += [{**null, "beside": ""}]
    strong = [blind(f"case_{k}", "strong", "sei-growth", "effect-found", "sei-growth", "right") for k in (1, 2)]
    studies = {"discovery_blind": BLIND, "discovery_hidden": rows, "discovery_cases": strong[:1]}
    text = made("discovery-summary", **studies, discovery_earlier=strong[1:])
    interval = exact_interval(1, 3).removeprefix("exact 95 % interval ")
    assert f"| fresh seeds | 3 | 2 | 0 | 0 | 0 | 1 ({interval}) | 1 of 2 |" in text
    assert "| hidden in measured records, beside one reference | 2 | 2 |" in text
    text = made("discovery-aims", **studies, discovery_earlier=strong[1:])
    assert "| right name, strong effects that can be told | 95 % | – | 2 of 2 |" in text
    assert "| wall time on two cores | at most 5 min | 3 of 3 | 2 of 2 |" in text
    text = made("discovery-hidden", **studies)
    assert "| cell | a | 2 | 2 | 0 | 0 | 2.0 |" in text
    assert "| time-lag | 1 of 1 | 1 of 1 |" in text


def test_mechanisms_found_are_counted_where_one_was_hidden(made):
    def row(case, hidden, verdict, named, rivals=""):
        errors = {"base_error": 5.0, "error": 1.0, "base_later_error": 9.0, "later_error": 1.5}
        found = {
            "verdict": verdict,
            "named": named,
            "rivals": rivals,
            "best": named or "?",
            "reason": "",
            "processor_s": 40.0,
        }
        return {"case": case, "hidden": hidden, **found, **errors}

    rows = [
        row("a", "sei-growth", "effect-found", "sei-growth"),
        row("b", "lithium-plating", "effect-found", "sei-growth"),
        row("c", "lithium-plating", "ambiguous", "sei-growth", "lithium-plating"),
        row("d", "", "unexplained", ""),
    ]
    text = made("life-discovery", life_discovery=rows)
    assert "1 of 3 hidden mechanisms named alone, 1 wrong names" in text
    assert "sei-growth or lithium-plating" in text
    assert "| d | not known | unexplained | none |" in text
    assert "5.0 → 1.0" in text


def test_modes_are_told_with_their_intervals(made):
    row = {"case": "a", "quantity": "Loss of lithium inventory [%]", "cycle": 200, "value": 4.0, "half": 0.2}
    text = made("life-modes", life_modes=[{**row, "per_100_cycles": 2.0, "half_per_100_cycles": 0.1}])
    assert "| life (cycle) | Loss of lithium inventory [%] |" in text
    assert "| a (200) | 4 ± 0.2 |" in text


def test_lives_are_told_by_their_task_with_the_largest_errors(made):
    starts = (("sei-0", 2.0, 0.01, 9), ("sei-0-start-1", 4.0, 0.03, 24), ("sei-1", 50.0, 0.02, 10))
    rows = [
        {"task": task, "initial_mape": start, "mape": mape, "q_mape": 0.1, "fade_error": mape, "simulations": count}
        for task, start, mape, count in starts
    ]
    text = made("ageing", ageing=rows)
    assert "| sei-0 | 2 to 4 % | 0.03 % | 0.03 % | 9 to 24 |" in text
    assert "Mean total MAPE 0.02 %, charge 0.1 % over 3 runs" in text


def test_methods_have_their_worst_task(made):
    errors = (("a", "bo", 1.0), ("b", "bo", 4.0), ("a", "full", 60.0), ("b", "full", 0.1))
    rows = [{"task": task, "method": method, "mape": mape, "initial_mape": 50.0} for task, method, mape in errors]
    text = made("own-lives", own_lives=rows)
    assert "| bo | 2 % | 4 % (b) |" in text
    assert "3 of 4 runs have a smaller error than their start." in text


def test_a_forecast_is_bold_where_the_band_does_not_hold_it(made):
    def row(cycle, measured):
        return {
            "cell": "x",
            "cycle": cycle,
            "fitted_to": 200,
            "measured_ah": measured,
            "predicted_ah": 1.0,
            "low_ah": 0.9,
            "high_ah": 1.1,
        }

    text = made("whole-life", whole_life=[row(200, 1.0), row(250, 1.0), row(300, 0.8)])
    assert "| 200 (fitted) | 1.000 | 1.000 (0.900 to 1.100) | +0.0 % |" in text
    assert "| 300 | 0.800 | 1.000 (0.900 to 1.100) | **+25.0 %** |" in text
    assert "x: 25.0 % off at cycle 300 (aim: 2 %), 25.0 % at most; the band holds 1 of 2 cycles" in text


def test_a_law_of_the_fade_has_one_line(made):
    rows = [
        {"cell": "x", "law": "line", "fitted_to": fitted, "rms_pct": 0.5, "cycle": 500, "off_pct": off}
        for fitted, off in ((200, -3.0), (300, 2.0))
    ]
    assert "| x | line | 0.50 % | -3.0 % | 0.50 % | +2.0 % |" in made("fade-trends", fade_trends=rows)


def test_an_agent_alone_is_told_by_cell_and_at_the_fastest_rate(made):
    rows = [
        {"task": task, "chemistry": "Chen2020", "rates": rates, "mape": mape}
        for task, rates, mape in (("a", "0.2C/1C", 1.0), ("b", "2C/1C", 4.0))
    ]
    text = made("agent-alone", agent_alone=rows)
    assert "| Chen2020 | 2 | 2 | 4 |" in text
    assert "| Chen2020 at 2C | 1 | 4 | 4 |" in text


def test_a_low_fidelity_model_is_told_with_the_tasks_that_lose_by_it(made):
    rows = [
        {**suite_row(task, method, mape), "simulator_s": time}
        for task, method, mape, time in (
            ("a", "no-low-fidelity", 0.1, 10.0),
            ("a", "hybrid", 0.2, 5.0),
            ("b", "no-low-fidelity", 0.3, 10.0),
            ("b", "hybrid", 0.2, 20.0),
        )
    ]
    text = made("low-fidelity", low_fidelity=rows)
    assert "Time with it by that without it: 0.5 to 2." in text
    assert "Larger error with it: a (0.2 and 0.1 %)." in text


def test_tasks_that_begin_elsewhere_stand_beside_their_earlier_rows(made):
    def row(early, mape, simulations):
        own = {"task": "extreme-1", "chemistry": "Chen2020", "rates": "1C/2C", "simulations": simulations}
        return {**own, "early_objective": early, "mape": mape, "low_fidelity_simulations": 2 * simulations}

    text = made("begun-elsewhere", published_led=[row(40.0, 0.3, 32)], begun_elsewhere=[row(0.02, 0.01, 3)])
    assert "| extreme-1 (Chen2020 1C/2C) | 40.0 → 0.02 | 0.3 → 0.01 | 32 → 3 | 64 → 6 |" in text


def record(cell, name, role, rms_mv, rms_k=0.5):
    return {"cell": cell, "record": name, "role": role, "rms_mv": rms_mv, "rms_99_mv": rms_mv / 2, "rms_k": rms_k}


def test_measured_cells_are_averaged_by_cell_and_compared_with_their_aim(made):
    cell = "Panasonic 18650PF"
    rows = [record(cell, "C20", "fitted", 4.0), record(cell, "1C", "fitted", 6.0)]
    rows += [record(cell, "US06", "held out", 20.0), record(cell, "2C", "held out", 30.0)]
    rows += [record(f"{cell}, warm", "C20", "fitted", 5.0), record(f"{cell}, warm", "2C", "held out", 12.0)]
    text = made("cell-by-cell", real_cells=rows)
    assert f"| {cell} | 2+2 | 5 | 25.0 | 30.0 |" in text
    assert "2 records held out, without second fits: 20.0 to 30.0 mV rms, median 25.0" in text
    assert "1 of the 1 records held out of both fits gain; their mean goes from 30.0 to 12.0 mV rms" in text
    assert f"| {cell} | US06 | held out | rms | 15 mV | 20.0 mV | **missed** |" in text
    assert f"| {cell} | US06 | held out | temperature | 1.5 K | 0.5 K | met |" in text


def test_two_ways_of_a_fit_are_beside_each_other_and_what_has_no_record_is_empty(made):
    values = {"own_mv": 4.0, "shared_mv": 2.0}
    rows = [{"cell": "a", "role": role, **values} for role in ("fitted", "held out")]
    text = made("starts", starts=[*rows, {"cell": "b", "role": "fitted", **values}])
    assert "| a | 1+1 | 4 → 2 | 4 → 2 |" in text
    assert "| b | 1+0 | 4 → 2 |  |" in text


def test_a_low_fidelity_model_is_judged_by_cells_that_were_fitted_both_ways(made):
    def fit(cell, led, simulations, held_out_mv):
        errors = {"fitted_mv": 5.0, "held_out_mv": held_out_mv}
        return {"cell": cell, "led": led, "simulations": simulations, "simulator_s": simulations, **errors}

    rows = [fit("a", "none", 100, 9.0), fit("a", "coarse DFN", 25, 8.0)]
    rows += [fit("b", "none", 100, 9.0), fit("b", "coarse DFN", 50, 9.5), fit("c", "none", 100, 9.0)]
    text = made("low-fidelity-cells", low_fidelity_cells=rows)
    assert "Over 2 cells, a fit takes 0.25 to 0.5 times the simulations" in text
    assert "by +0.0 to +0.0 mV (fitted records) and by -1.0 to +0.5 mV (held out)" in text
    assert "Not run with the coarse DFN: c." in text


def test_spectra_are_averaged_by_fit_and_columns_without_values_are_left_out(made):
    parts = {"resistance_mohm": 3.0, "reactance_mohm": 1.0, "ohmic_mohm": 20.0, "measured_ohmic_mohm": 21.0}
    empty = dict.fromkeys(parts, math.nan)
    rows = [{"fit": "alone", "role": "fitted", "rms_mv": mv, **empty} for mv in (10.0, 30.0)]
    rows += [{"fit": "alone", "role": "held out", "rms_mv": math.nan, **parts}]
    text = made("impedance", impedance=rows)
    assert "| alone | 20.0 | 3 | 1 | 20.0 | 21.0 |" in text
    assert "voltage rms, held out" not in text


def test_one_record_from_two_sets_and_the_chemistry_that_its_potentials_tell(made):
    fits = [
        {"record": "r", "parameters": way, "taken": "X (negative) and Y (positive)"} for way in ("Chen2020", "nearest")
    ]
    rows = [{**fit, "rms_mv": mv} for fit, mv in zip(fits, (30.0, 12.0), strict=True)]
    assert "| r | X (negative), Y (positive) | 30.0 → 12.0 |" in made("nearest-set", nearest_set=rows)
    told = {"cell": "a", "chemistry": "LCO", "hours": 1.0, "rms_mv": 11.0}
    rows = [{**told, "taken": "LCO", "other_mv": 11.5}, {**told, "taken": "NMC", "other_mv": 14.0, "cell": "b"}]
    text = made("nearest-potentials", nearest_potentials=rows)
    assert "For 1 of 2 records" in text
    assert "0.5 to 3 mV more (least: a, 1.0 h)" in text
