"""The simulator after a search: outcomes are journalled and not simulated again, and progress is reported."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..encoding import decode_outcome, encode_outcome
from ..inference.simulating import Simulating
from ..parameters import Candidate
from ..simulation import Outcome
from ..task import Experiment, Protocol
from .journal import Journal

ANALYSIS_SIMULATION = "appraisal-simulation"

_WHOLE_TASK: list[str] = []

FINAL_SCORES, FIXED, NEXT = "final scores", "what the record fixes", "what to measure next"
NOT_FITTED, FORECAST, BAND = "records that were not fitted", "forecast", "band of the forecast"
REFERENCE = "residuals with reference accuracy"
"""What the simulations after a search are for."""

Watch = Callable[[str, int, int], None]
"""Called with what the simulations are for, how many are done, and how many there are."""


@dataclass(eq=False)
class _SimulatingAround:
    """A simulator that asks another one; see `Simulating`."""

    inner: Simulating

    def simulate_finer(self, candidate: Candidate) -> Outcome | None:
        """See `RunHooks.simulate_finer`; it is one simulation, and neither written down nor counted."""
        return self.inner.simulate_finer(candidate)

    def next_protocols(self) -> Mapping[str, Protocol]:
        """See `RunHooks.next_protocols`."""
        return self.inner.next_protocols()


@dataclass(eq=False)
class JournalledSimulations(_SimulatingAround):
    """A simulator behind the journal; see `Simulating`.

    Each outcome is written whole, since what is derived from it depends on other outcomes too.
    """

    journal: Journal
    known: list[Mapping[str, Any]]  # The run's events `ANALYSIS_SIMULATION` so far; ``inner`` simulates the rest.

    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        """See `RunHooks.simulate`."""
        known, missing = self._sorted(candidates, _WHOLE_TASK, exact)
        made = self.inner.simulate([candidates[place] for place in missing], exact) if missing else ()
        return self._all(candidates, _WHOLE_TASK, known, missing, made, exact)

    def simulate_variant(
        self, candidates: Sequence[Candidate], experiments: tuple[Experiment, ...], exact: bool = False
    ) -> Iterator[tuple[int, Outcome]] | None:
        """See `RunHooks.simulate_variant`."""
        names = [experiment.name for experiment in experiments]
        known, missing = self._sorted(candidates, names, exact)
        left = [candidates[place] for place in missing]
        made = self.inner.simulate_variant(left, experiments, exact) if missing else ()
        return None if made is None else self._all(candidates, names, known, missing, made, exact)

    def _sorted(
        self, candidates: Sequence[Candidate], experiments: list[str], exact: bool
    ) -> tuple[dict[int, Outcome], list[int]]:
        """The outcomes that are known, by place, and the places of the others."""
        known = {
            place: decode_outcome(event["outcome"])
            for place, candidate in enumerate(candidates)
            for event in self.known
            if event["experiments"] == experiments
            and event["candidate"] == dict(candidate)
            and event.get("exact", False) == exact
        }
        return known, [place for place in range(len(candidates)) if place not in known]

    def _all(
        self,
        candidates: Sequence[Candidate],
        experiments: list[str],
        known: Mapping[int, Outcome],
        missing: Sequence[int],
        made: Iterable[tuple[int, Outcome]],
        exact: bool,
    ) -> Iterator[tuple[int, Outcome]]:
        yield from known.items()
        for number, outcome in made:
            place = missing[number]
            event = simulated(candidates[place], outcome, experiments, exact)
            self.journal.append(ANALYSIS_SIMULATION, **event)
            if exact:
                # A forecast is simulated before its band, which begins with it.
                self.known.append(event)
            yield place, outcome


def simulated(
    candidate: Candidate, outcome: Outcome, experiments: Sequence[str] = (), exact: bool = False
) -> dict[str, Any]:
    """What an event `ANALYSIS_SIMULATION` holds: an outcome of the whole task, or of experiments by their names."""
    event = {"experiments": [*experiments], "candidate": dict(candidate), "outcome": encode_outcome(outcome)}
    return event | ({"exact": True} if exact else {})


@dataclass(eq=False)
class WatchedSimulations(_SimulatingAround):
    """A simulator after the search; see `Simulating`.

    What serves one purpose is counted on from round to round: how many rounds of draws there are is not known before.
    """

    watch: Watch  # Told at the beginning and after each simulation.
    variants: str = NEXT  # What simulations of other experiments than the task's are for.
    exact: str = FINAL_SCORES  # What those with reference accuracy are for.

    def __post_init__(self) -> None:
        self._done: Counter[str] = Counter()

    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        """See `RunHooks.simulate`."""
        purpose = self.exact if exact else FIXED
        return self._counted(purpose, self.inner.simulate(candidates, exact), len(candidates))

    def simulate_variant(
        self, candidates: Sequence[Candidate], experiments: tuple[Experiment, ...], exact: bool = False
    ) -> Iterator[tuple[int, Outcome]] | None:
        """See `RunHooks.simulate_variant`."""
        outcomes = self.inner.simulate_variant(candidates, experiments, exact)
        return None if outcomes is None else self._counted(self.variants, outcomes, len(candidates))

    def _counted(
        self, purpose: str, outcomes: Iterable[tuple[int, Outcome]], total: int
    ) -> Iterator[tuple[int, Outcome]]:
        before = self._done[purpose]
        self.watch(purpose, before, before + total)
        for pair in outcomes:
            self._done[purpose] += 1
            self.watch(purpose, self._done[purpose], before + total)
            yield pair
