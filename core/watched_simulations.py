"""Simulations that are counted aloud as they finish."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from .parameters import Candidate
from .post_fit_analysis import Simulating
from .simulation import Outcome
from .task import Experiment, Protocol

FINAL_SCORES, FIXED, NEXT = "final scores", "what the record fixes", "what to measure next"
NOT_FITTED = "records that were not fitted"
REFERENCE = "residuals with reference accuracy"
"""What the simulations after a search are for."""

Watch = Callable[[str, int, int], None]
"""Told what the simulations are for, how many are done, and how many there are."""


class WatchedSimulations:
    """A simulator after the search; see `Simulating`.

    ``watch`` is told at the beginning and after each simulation; ``variants`` is what simulations of other experiments
    than the task's are for, ``exact`` what those with reference accuracy are for.
    """

    def __init__(self, inner: Simulating, watch: Watch, variants: str = NEXT, exact: str = FINAL_SCORES) -> None:
        self._inner = inner
        self._watch = watch
        self._variants = variants
        self._exact = exact

    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        """See `RunHooks.simulate`."""
        purpose = self._exact if exact else FIXED
        return self._counted(purpose, self._inner.simulate(candidates, exact), len(candidates))

    def simulate_finer(self, candidate: Candidate) -> Outcome | None:
        """See `RunHooks.simulate_finer`."""
        return self._inner.simulate_finer(candidate)

    def simulate_variant(
        self, candidates: Sequence[Candidate], experiments: tuple[Experiment, ...], exact: bool = False
    ) -> Iterator[tuple[int, Outcome]] | None:
        """See `RunHooks.simulate_variant`."""
        outcomes = self._inner.simulate_variant(candidates, experiments, exact)
        return None if outcomes is None else self._counted(self._variants, outcomes, len(candidates))

    def next_protocols(self) -> Mapping[str, Protocol]:
        """See `RunHooks.next_protocols`."""
        return self._inner.next_protocols()

    def _counted(
        self, purpose: str, outcomes: Iterable[tuple[int, Outcome]], total: int
    ) -> Iterator[tuple[int, Outcome]]:
        self._watch(purpose, 0, total)
        for done, pair in enumerate(outcomes, start=1):
            self._watch(purpose, done, total)
            yield pair
