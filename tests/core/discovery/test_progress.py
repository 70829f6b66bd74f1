import pytest
from bsa.core.discovery.progress import Progress, duration


def test_each_candidate_has_a_line_and_its_place() -> None:
    lines: list[str] = []
    now = iter([0.0, 100.0])
    progress = Progress(lines.append, lambda: next(now))
    progress.estimate(50, 30)
    assert lines == ["at most 30 simulations until these are compared: about 60 s at the present pace; more may follow"]
    progress.estimate(0, 30)
    assert lines.pop() == "at most 30 simulations until these are compared; more may follow"
    progress.estimate(50, 0)
    assert len(lines) == 1
    progress.begin(2)
    progress.ended("one", "cannot be fitted")
    progress.ended("two", "a short fit")
    assert lines[1:] == ["  one: cannot be fitted (1 of 2)", "  two: a short fit (2 of 2)"]


@pytest.mark.parametrize(("seconds", "words"), [(12.2, "about 12 s"), (200.0, "about 3 min")])
def test_durations_are_said_as_people_say_them(seconds: float, words: str) -> None:
    assert duration(seconds) == words
