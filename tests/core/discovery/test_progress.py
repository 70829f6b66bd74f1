import discovery_toy as toy
import pytest
from bsa.core.discovery.findings import Nomination
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
    first, second = (Nomination(effect) for effect in (toy.QUADRATIC, toy.SLOW))
    progress.refitted(first, 10.0)
    progress.refitted(second, 10.0)
    assert lines[1] == f"  {first.effect.key}: cannot be fitted (1 of 2)"
    assert lines[2] == f"  {second.effect.key}: cannot be fitted (2 of 2)"


@pytest.mark.parametrize(("seconds", "words"), [(12.2, "about 12 s"), (200.0, "about 3 min")])
def test_durations_are_said_as_people_say_them(seconds: float, words: str) -> None:
    assert duration(seconds) == words
