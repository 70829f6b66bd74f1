from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bsa.core.task import CellModel
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.campaign.study_cell import write_found
from bsa.experiments.studies import coverage


def rows(number: int, contained: list[int]) -> list[dict[str, Any]]:
    shared = {"task": number, "grade": "fixed", "cost": 1.1, "true_cost": 1.0, "lower": 1.0, "upper": 3.0}
    return [{**shared, "contained": hit, "true": 2.5 if hit else 4.0} for hit in contained]


def test_every_task_is_a_cell_and_its_intervals_are_counted(tmp_path: Path) -> None:
    plan = coverage.plan_coverage(tmp_path / "store", 4, 1, "SPMe", 30, 10)
    assert [cell.asked["number"] for cell in plan.cells] == [0, 1, 2, 3]
    assert len({cell.identity for cell in plan.cells}) == 4
    fewer = coverage.plan_coverage(tmp_path / "store", 2, 1, "SPMe", 30, 10)
    assert [cell.identity for cell in fewer.cells] == [cell.identity for cell in plan.cells[:2]]
    other = coverage.plan_coverage(tmp_path / "store", 2, 1, "SPMe", 20, 10)
    assert not {cell.identity for cell in other.cells} & {cell.identity for cell in plan.cells}
    for number, cell in enumerate(plan.cells[:3]):
        answered = replace(cell, act=lambda folder, number, **asked: {"rows": rows(number, [1, 1, 0])})
        answered.run(plan.store.cell(cell.identity), plan.store)
        assert cell.asked["number"] == number
    assert "| fixed | 9 | 67 % | 30 to 93 % | 0.50 |" in write_found(plan, coverage.coverage_table)
    assert len((plan.folder / "coverage.csv").read_text().splitlines()) == 10


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_measured_cell_has_many_parameters_with_truths_from_their_priors(seed: int) -> None:
    cell = CellModel("Chen2020", "SPMe", {"contact resistance": "true"})
    space, truth, changes = coverage._measured_cell(cell, np.random.default_rng(seed))
    assert 13 <= len(space) == changes == len(truth) <= 23
    # The unseen discharge starts full: the state of charge that is searched is that of the measured record alone.
    assert "Initial state of charge: measured" in space
    assert "Initial state of charge" not in space
    # Neither starts at a rest voltage: what no record tells would change no interval but its own.
    assert not any("voltage correction" in name for name in space.names)
    off = np.array([parameter.coordinate(truth[parameter.name]) for parameter in space])
    assert np.all(np.abs(off) < 5.0)
    assert 0.5 < np.sqrt(np.mean(off**2)) < 1.6


def test_intervals_that_miss_together_count_as_fewer() -> None:
    def bounds(*tasks: list[int]) -> str:
        found = [row for number, contained in enumerate(tasks) for row in rows(number, contained)]
        return coverage.coverage_table(found).splitlines()[-1].split("|")[4].strip()

    # 6 of 9 misses and hits, apart: as of nine intervals; all of a task alike: as of three.
    assert bounds([1, 1, 0], [1, 0, 1], [0, 1, 1]) == "30 to 93 %"
    low, high = (float(end) for end in bounds([1, 1, 1], [1, 1, 1], [0, 0, 0]).removesuffix(" %").split(" to "))
    assert low < 15
    assert high > 97
    assert bounds([1, 1, 1], [1, 1, 1], [1, 1, 1]) == "29 to 100 %"


def test_excess_is_one_number_a_task() -> None:
    assert coverage.excesses([*rows(0, [1, 0]), *rows(1, [1])]) == pytest.approx([0.1, 0.1])


def test_a_sampled_record_keeps_the_ends_of_its_steps() -> None:
    time = np.array([0.0, 3.0, 47.0, 47.001, 90.0])
    steps = (Step(StepKind.CC_CHARGE, 0, 3, 1), Step(StepKind.REST, 3, 5, 1))
    clean = Trajectory(time, np.array([-1.0, -1, -1, 0, 0]), np.linspace(3.0, 4.0, 5), None, steps)
    found = coverage.sampled(clean, 20.0)
    assert found.time.tolist() == pytest.approx([0, 20, 40, 47, 47.001, 67.001, 87.001, 90])
    assert [(step.start, step.stop) for step in found.steps] == [(0, 4), (4, 8)]
    assert found.voltage[-1] == 4.0


@pytest.mark.slow
def test_a_drawn_task_is_fitted_to_its_noise_and_judged(tmp_path: Path) -> None:
    row = coverage.one_task(tmp_path, 1234, 0, "SPM", 20, 100)
    # Nine parameters, and three voltages: what the parameters leave open, and with what the fit is off by.
    assert len(row["rows"]) == 9 + 2 * 3
    grades = {"fixed", "loose", "open", "voltage", "voltage, with misfit"}
    assert {found["grade"] for found in row["rows"]} <= grades
    halves = {
        grade: [one["upper"] - one["lower"] for one in row["rows"] if one["grade"] == grade]
        for grade in ("voltage", "voltage, with misfit")
    }
    assert np.all(np.array(halves["voltage, with misfit"]) > np.array(halves["voltage"]))
    assert coverage.excesses(row["rows"])[0] < 0.1
    assert coverage.draw(1234, 0, "SPM", 20).truth == coverage.draw(1234, 0, "SPM", 20).truth
