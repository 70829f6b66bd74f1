import math

import pytest
from bsa.backends.rules.reading import PastTrial, Prompt
from bsa.backends.rules.trust import failed_in_a_row, trusted_length


def prompt(*trials: PastTrial, **more: object) -> Prompt:
    present = min(trials, key=lambda trial: trial.misfit).index if trials else 0
    return Prompt({}, {}, {}, trials=trials, present=present, **more)  # type: ignore[arg-type]


def trial(index: int, steps: float, misfit: float, asked_by: str = "search") -> PastTrial:
    return PastTrial(index, (steps, 0.0), {}, asked_by, misfit)


def test_without_failures_a_change_may_be_long() -> None:
    assert trusted_length(prompt()) == 5.0
    assert trusted_length(prompt(trial(0, -3.0, 90.0), trial(1, 0.0, 10.0))) == 5.0


def test_a_change_that_helped_after_a_failure_allows_one_twice_as_long() -> None:
    first, failed, helped = trial(0, -1.0, 90.0), trial(1, 3.0, 300.0), trial(2, 0.0, 10.0)
    assert trusted_length(prompt(first, failed, helped)) == pytest.approx(2.0)
    again = trial(3, 2.0, 11.0)
    assert trusted_length(prompt(first, failed, helped, again)) < 2.0
    assert failed_in_a_row(prompt(first, failed, helped, again)) == 1


@pytest.mark.parametrize(("misfit", "share"), [(10.0, 0.59), (100.0, 0.16), (math.inf, 0.16)])
def test_the_worse_a_change_was_the_shorter_is_the_next(misfit: float, share: float) -> None:
    assert trusted_length(prompt(trial(0, 0.0, 10.0), trial(1, 3.0, misfit))) == pytest.approx(3.0 * share, rel=0.02)


def test_measurements_are_no_attempts() -> None:
    assert trusted_length(prompt(trial(0, 0.0, 10.0), trial(1, 0.5, 300.0, "jacobian"))) == 5.0


def test_where_no_misfits_are_told_what_was_no_better_shortens_the_next() -> None:
    assert trusted_length(prompt(attempt=(1.0, 0.0))) == pytest.approx(0.42, rel=0.01)
    tried = PastTrial(3, (2.0, 0.0), {}, "search")
    assert trusted_length(Prompt({}, {}, {}, trials=(tried,))) == pytest.approx(0.84, rel=0.01)
