"""Simulations after a search are counted on from round to round."""

from collections.abc import Iterator, Mapping, Sequence

from bsa.core.parameters import Candidate
from bsa.core.run.later_simulations import FINAL_SCORES, FIXED, NEXT, WatchedSimulations
from bsa.core.simulation import Outcome
from bsa.core.task import Experiment, Protocol


class Prompt:
    """A simulator that has each outcome at once."""

    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        return ((place, Outcome(())) for place in range(len(candidates)))

    def simulate_finer(self, candidate: Candidate) -> Outcome | None:
        return None

    def simulate_variant(
        self, candidates: Sequence[Candidate], experiments: tuple[Experiment, ...], exact: bool = False
    ) -> Iterator[tuple[int, Outcome]] | None:
        return self.simulate(candidates, exact)

    def next_protocols(self) -> Mapping[str, Protocol]:
        return {}


def test_a_further_round_for_one_purpose_is_counted_on() -> None:
    seen: list[tuple[str, int, int]] = []
    watched = WatchedSimulations(Prompt(), lambda *words: seen.append(words))
    for candidates, exact in ([{}] * 2, False), ([{}], True), ([{}] * 2, False):
        assert len(list(watched.simulate(candidates, exact))) == len(candidates)
    assert seen == [
        *((FIXED, done, 2) for done in range(3)),
        *((FINAL_SCORES, done, 1) for done in range(2)),
        *((FIXED, done, 4) for done in range(2, 5)),
    ]


def test_a_round_that_is_left_early_counts_what_it_made() -> None:
    seen: list[tuple[str, int, int]] = []
    watched = WatchedSimulations(Prompt(), lambda *words: seen.append(words))
    made = watched.simulate_variant([{}] * 3, ())
    assert made is not None
    next(iter(made))
    assert watched.simulate_variant([{}], ()) is not None
    list(watched.simulate_variant([{}], ()) or ())
    assert seen == [(NEXT, 0, 3), (NEXT, 1, 3), (NEXT, 1, 2), (NEXT, 2, 2)]
