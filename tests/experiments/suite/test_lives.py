"""Ageing cases that are drawn by seed."""

from collections import Counter

import pytest
from bsa.core.target import change_of, target_named
from bsa.experiments.suite.build import build_task
from bsa.experiments.suite.lives import life_cases
from bsa.experiments.suite.selection import load_suite
from bsa.experiments.suite.target import cell_of, experiment_of
from bsa.plugins.pybamm.before_search.presets import preset_space

CASES = life_cases(2026)


def test_twenty_cases_have_each_law_of_growth_and_every_other_mechanism() -> None:
    assert list(CASES) == [f"life-{number}" for number in range(20)]
    assert set(Counter(case.options["SEI"] for case in CASES.values()).values()) == {4}
    plating = Counter(case.options.get("lithium plating", "none") for case in CASES.values())
    assert set(plating) == {"none", "irreversible", "partially reversible"}
    assert {"none", "stress-driven"} == {case.options.get("loss of active material", "none") for case in CASES.values()}


def test_a_case_depends_on_the_seed_and_its_number_alone() -> None:
    assert life_cases(2026, 3)["life-2"] == CASES["life-2"]
    assert life_cases(1, 3)["life-2"].changes != CASES["life-2"].changes
    assert load_suite("lives", seed=2026, count=3)["life-2"] == CASES["life-2"]


@pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))
def test_what_is_hidden_is_searched_and_inside_its_bounds(case) -> None:  # type: ignore[no-untyped-def]
    space = preset_space("Chen2020", "ageing", options=case.options)
    for name, value in case.hidden.items():
        assert space[name].lower <= value <= space[name].upper
    assert change_of({name: target_named(name) for name in case.hidden}, case.hidden)
    assert experiment_of(case).long
    assert len(experiment_of(case).protocol or ()) == 200


@pytest.mark.slow
def test_a_life_with_plating_is_made(tmp_path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    """The exchange current of plating is a function, and is hidden as a multiplier."""
    monkeypatch.setenv("BSA_CACHE", str(tmp_path))
    number = next(case.number for case in CASES.values() if "lithium plating" in case.options)
    short = life_cases(2026, cycles=3)[f"life-{number}"]
    task = build_task(short)
    assert task.long
    assert set(short.hidden) <= set(task.space.names)
    assert cell_of(short).options["lithium plating"] != "none"
    assert task.experiments[0].target.cycle_table is not None
    assert len(task.experiments[0].target.cycle_table) == 3
