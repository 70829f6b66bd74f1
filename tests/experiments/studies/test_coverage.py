import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.studies import coverage


def entry(number: int, contained: list[int], grade: str = "fixed") -> dict[str, Any]:
    rows = [{"task": number, "grade": grade, "contained": hit, "cost": 1.1, "true_cost": 1.0} for hit in contained]
    return {"task": number, "rows": rows, "note": "ended"}


def test_a_stopped_study_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def one_task(seed: int, number: int, model: str, points: int, simulations: int) -> dict[str, Any]:
        asked.append(number)
        if number == 2 and asked.count(2) == 1:
            raise KeyboardInterrupt
        return entry(number, [1, 1, 0])

    monkeypatch.setattr(coverage, "one_task", one_task)

    def run() -> list[dict[str, Any]]:
        return coverage.run_coverage(tmp_path, 4, 1, "SPMe", 30, 10, lambda line: None)

    with pytest.raises(KeyboardInterrupt):
        run()
    kept = tmp_path / "coverage-SPMe-30-10-1.jsonl"
    kept.write_text(kept.read_text() + '{"task": 3, "rows"')  # torn by a crash
    assert len(run()) == 12
    assert asked == [0, 1, 2, 2, 3]
    assert [json.loads(line)["task"] for line in kept.read_text().splitlines()] == [0, 1, 2, 3]
    assert "| fixed | 12 | 67 % | exact 95 % interval 35 to 90 % |" in (tmp_path / "coverage.md").read_text()


def test_excess_is_one_number_a_task() -> None:
    rows = [*entry(0, [1, 0])["rows"], *entry(1, [1])["rows"]]
    assert coverage.excesses(rows) == pytest.approx([0.1, 0.1])


def test_a_sampled_record_keeps_the_ends_of_its_steps() -> None:
    time = np.array([0.0, 3.0, 47.0, 47.001, 90.0])
    steps = (Step(StepKind.CC_CHARGE, 0, 3, 1), Step(StepKind.REST, 3, 5, 1))
    clean = Trajectory(time, np.array([-1.0, -1, -1, 0, 0]), np.linspace(3.0, 4.0, 5), None, steps)
    found = coverage.sampled(clean, 20.0)
    assert found.time.tolist() == pytest.approx([0, 20, 40, 47, 47.001, 67.001, 87.001, 90])
    assert [(step.start, step.stop) for step in found.steps] == [(0, 4), (4, 8)]
    assert found.voltage[-1] == 4.0


@pytest.mark.slow
def test_a_drawn_task_is_fitted_to_its_noise_and_judged() -> None:
    row = coverage.one_task(1234, 0, "SPMe", 20, 100)
    assert len(row["rows"]) == 12
    assert {found["grade"] for found in row["rows"]} <= {"fixed", "loose", "open", "voltage"}
    assert coverage.excesses(row["rows"])[0] < 0.1
    assert coverage.draw(1234, 0, "SPMe", 20).truth == coverage.draw(1234, 0, "SPMe", 20).truth
