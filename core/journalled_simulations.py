"""Simulations that are written down as they finish, and not made again by a run that was interrupted meanwhile."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from .encoding import decode_outcome, encode_outcome
from .journal import Journal
from .parameters import Candidate
from .post_fit_analysis import Simulating
from .simulation import Outcome
from .task import Experiment, Protocol

ANALYSIS_SIMULATION = "appraisal-simulation"

_WHOLE_TASK: list[str] = []


class JournalledSimulations:
    """A simulator behind the journal; see `Simulating`.

    ``inner`` simulates what the events of the interrupted run do not hold. Each outcome is written whole, for what is
    judged of it depends on others.
    """

    def __init__(self, inner: Simulating, journal: Journal, earlier: Iterable[Mapping[str, Any]]) -> None:
        self._inner = inner
        self._journal = journal
        self._known = [event for event in earlier if event["event"] == ANALYSIS_SIMULATION]

    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        """See `RunHooks.simulate`."""
        known, missing = self._sorted(candidates, _WHOLE_TASK)
        made = self._inner.simulate([candidates[place] for place in missing], exact) if missing else ()
        return self._all(candidates, _WHOLE_TASK, known, missing, made)

    def simulate_finer(self, candidate: Candidate) -> Outcome | None:
        """See `RunHooks.simulate_finer`; it is one simulation, and made again."""
        return self._inner.simulate_finer(candidate)

    def simulate_variant(
        self, candidates: Sequence[Candidate], experiments: tuple[Experiment, ...], exact: bool = False
    ) -> Iterator[tuple[int, Outcome]] | None:
        """See `RunHooks.simulate_variant`."""
        if exact:
            # Names do not tell the two accuracies apart, and final scores are written down by themselves.
            return self._inner.simulate_variant(candidates, experiments, exact)
        names = [experiment.name for experiment in experiments]
        known, missing = self._sorted(candidates, names)
        left = [candidates[place] for place in missing]
        made = self._inner.simulate_variant(left, experiments) if missing else ()
        return None if made is None else self._all(candidates, names, known, missing, made)

    def next_protocols(self) -> Mapping[str, Protocol]:
        """See `RunHooks.next_protocols`."""
        return self._inner.next_protocols()

    def _sorted(self, candidates: Sequence[Candidate], experiments: list[str]) -> tuple[dict[int, Outcome], list[int]]:
        """The outcomes that are known, by place, and the places of the others."""
        known = {
            place: decode_outcome(event["outcome"])
            for place, candidate in enumerate(candidates)
            for event in self._known
            if event["experiments"] == experiments and event["candidate"] == dict(candidate)
        }
        return known, [place for place in range(len(candidates)) if place not in known]

    def _all(
        self,
        candidates: Sequence[Candidate],
        experiments: list[str],
        known: Mapping[int, Outcome],
        missing: Sequence[int],
        made: Iterable[tuple[int, Outcome]],
    ) -> Iterator[tuple[int, Outcome]]:
        yield from known.items()
        for number, outcome in made:
            place = missing[number]
            self._journal.append(
                ANALYSIS_SIMULATION,
                experiments=experiments,
                candidate=dict(candidates[place]),
                outcome=encode_outcome(outcome),
            )
            yield place, outcome
