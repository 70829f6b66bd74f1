from types import SimpleNamespace

from bsa.plugins.agent.step_size import step_size


def trials(*objectives: float) -> list[SimpleNamespace]:
    first = SimpleNamespace(phase="initial", objective=10.0)
    return [first, *(SimpleNamespace(phase="search", objective=value) for value in objectives)]


def test_it_halves_after_a_worse_attempt_and_recovers_after_better_ones() -> None:
    assert step_size(trials()) == 1.0
    assert step_size(trials(12.0)) == 0.5
    assert step_size(trials(12.0, 11.0)) == 0.25
    assert step_size(trials(12.0, 11.0, 9.0)) == 0.375
    assert step_size(trials(9.0, 8.0)) == 1.0


def test_it_never_vanishes() -> None:
    assert step_size(trials(*[20.0] * 50)) == 0.1


def test_warm_up_trials_do_not_count() -> None:
    warm = SimpleNamespace(phase="warm-up", objective=99.0)
    assert step_size([*trials(), warm]) == 1.0
