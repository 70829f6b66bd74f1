"""The suites and the way parts of them are chosen."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.suite.case import SuiteCase, protocol
from bsa.experiments.suite.generated import COLUMNS, all_cases, generate, generated_cases, write
from bsa.experiments.suite.published import _BESIDE_THE_REPOSITORY, published_cases
from bsa.experiments.suite.random import SETS, random_cases
from bsa.experiments.suite.selection import choose, load_suite
from bsa.plugins.pybamm.before_search.presets import resolve_space

has_published = pytest.mark.skipif(not _BESIDE_THE_REPOSITORY.is_dir(), reason="needs ../shared/reference-suite")


def _cases(count: int = 40) -> dict[str, SuiteCase]:
    made = [
        SuiteCase(mode, number, parameter_set, 1.0, 1.0, {})
        for number in range(count // 4)
        for mode in ("regular", "extreme")
        for parameter_set in ("A", "B")
    ]
    numbered = [replace(case, number=place) for place, case in enumerate(made)]
    return {case.key: case for case in numbered}


def test_protocol_is_the_papers() -> None:
    first, second = protocol(2, 0.2, 4.2, 2.5)
    assert first == second
    assert first[1] == "Charge at 2C until 4.2 V"
    assert first[5] == "Discharge at 0.2C until 2.5 V"


def test_every_combination_is_there_before_the_filters() -> None:
    counted = Counter((case.mode, case.parameter_set) for case in all_cases())
    assert set(counted.values()) == {9 * 12, 9 * 20}
    keys = [case.key for case in all_cases()]
    assert len(set(keys)) == len(keys)


def test_perturbations_follow_the_tables() -> None:
    first = next(case for case in all_cases() if case.mode == "regular")
    assert first.parameter_set == "Chen2020"
    assert tuple(first.changes) == COLUMNS
    assert first.changes["Negative particle radius [m]"] == pytest.approx(0.7 * 5.86e-6)
    assert first.changes["Negative electrode porosity"] == pytest.approx(0.29)
    assert first.changes["Negative electrode Bruggeman coefficient (electrolyte)"] == 1.5
    porosities = [
        value
        for case in all_cases()
        for name, value in case.changes.items()
        if case.mode == "extreme" and "porosity" in name
    ]
    assert min(porosities) >= 0.2
    assert max(porosities) <= 0.6


def test_generation_is_deterministic_and_fills_every_cell(tmp_path: Path) -> None:
    def keep(case: SuiteCase) -> bool:
        return case.number % 2 == 0

    cases = generate(keep)
    assert [case.key for case in cases] == [case.key for case in generate(keep)]
    assert set(Counter((case.mode, case.parameter_set) for case in cases).values()) == {20}
    write(cases, tmp_path / "cases.yaml")
    assert (tmp_path / "cases.yaml").read_text().count("\n") == 202


def test_the_committed_list_agrees_with_the_rules() -> None:
    rules = {case.key: case for case in all_cases()}
    cases = generated_cases()
    assert set(Counter((case.mode, case.parameter_set) for case in cases.values()).values()) == {20}
    for key, case in cases.items():
        assert case.rates == rules[key].rates
        assert case.changes == pytest.approx(dict(rules[key].changes), rel=1e-9)


@has_published
def test_published_cases_are_what_the_paper_says() -> None:
    cases = published_cases()
    assert Counter(case.mode for case in cases.values()) == {"regular": 100, "extreme": 100, "sei": 5}
    assert cases["regular-134"].parameter_set == "ORegan2022"
    assert cases["sei-3"].temperature_k == pytest.approx(318.15)
    assert "Ambient temperature [K]" not in cases["sei-3"].hidden


@has_published
def test_our_tables_make_the_published_cases() -> None:
    made = {
        (case.mode, case.parameter_set, case.rates, tuple(sorted(f"{name} {value:.9g}" for name, value in truth)))
        for case in all_cases()
        for truth in (case.changes.items(),)
    }
    for case in published_cases().values():
        if case.mode != "sei":
            truth = tuple(sorted(f"{name} {value:.9g}" for name, value in case.changes.items()))
            assert (case.mode, case.parameter_set, case.rates, truth) in made


def test_published_files_are_where_the_variable_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BSA_PUBLISHED_SUITE", str(tmp_path))
    with pytest.raises(BsaError, match=f"not in {tmp_path};.*set BSA_PUBLISHED_SUITE to the folder"):
        published_cases()


def test_published_files_elsewhere_are_named(tmp_path: Path) -> None:
    with pytest.raises(BsaError, match="not in"):
        published_cases(tmp_path)


def test_random_cases_depend_on_seed_and_number_alone() -> None:
    def keep(case: SuiteCase) -> bool:
        return len(case.changes) > 2

    few, many = random_cases(7, 3, keep=keep), random_cases(7, 9, keep=keep)
    assert all(many[key] == case for key, case in few.items())
    assert {case.parameter_set for case in many.values()} == set(SETS)
    assert random_cases(8, 3, keep=keep) != few
    assert all(len(case.changes) > 2 for case in many.values())


def test_a_number_is_spread_over_modes_and_cells() -> None:
    cases = _cases()
    ten = choose(cases, 8)
    assert set(Counter((case.mode, case.parameter_set) for case in ten.values()).values()) == {2}
    assert set(choose(cases, 4)) < set(ten)
    assert len(choose(cases, 1000)) == len(cases)


def test_cases_by_name_and_pattern() -> None:
    cases = _cases(8)
    assert list(choose(cases, "regular-0")) == ["regular-0"]
    assert all(case.mode == "extreme" for case in choose(cases, ["extreme-*"]).values())
    with pytest.raises(BsaError) as caught:
        choose(cases, "regulr-0")
    assert "regular-0" in caught.value.hint


def test_noise_is_off_by_default_and_put_on_every_case() -> None:
    assert {case.noise_v for case in load_suite("generated").values()} == {0.0}
    assert {case.noise_v for case in load_suite("generated", noise_v=1e-3).values()} == {1e-3}


def test_the_case_that_runtime_takes_by_default_exists() -> None:
    from inspect import signature

    from bsa.experiments.cli.bench import runtime_command

    defaults = {name: parameter.default for name, parameter in signature(runtime_command).parameters.items()}
    (case,) = choose(load_suite(defaults["suite"]), defaults["case"]).values()
    assert case.parameter_set == "Chen2020"


def _searched_are_perturbed(cases: dict[str, SuiteCase]) -> None:
    """In each regular case all nine searched parameters differ from the base cell, in each extreme one a single one."""
    searched = set(resolve_space("Chen2020", "geometry").names)
    assert len(searched) == 9
    for case in cases.values():
        if case.mode == "regular":
            assert set(case.changes) == searched
        elif case.mode == "extreme":
            assert set(case.changes) < searched
            assert len(case.changes) == 1


def test_the_searched_parameters_are_the_perturbed_ones() -> None:
    _searched_are_perturbed(generated_cases())


@has_published
def test_the_searched_parameters_are_the_papers() -> None:
    _searched_are_perturbed(published_cases())
