"""What is asked of a simulator after a search, and what that has taken."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from ..parameters import Candidate
from ..simulation import Outcome, in_order
from ..task import Experiment
from ..task import Protocol as StepProtocol


class Simulating(Protocol):
    """What an analysis needs of a run's plugins."""

    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        """See `RunHooks.simulate`."""
        ...

    def simulate_finer(self, candidate: Candidate) -> Outcome | None:
        """See `RunHooks.simulate_finer`."""
        ...

    def simulate_variant(
        self, candidates: Sequence[Candidate], experiments: tuple[Experiment, ...], exact: bool = False
    ) -> Iterator[tuple[int, Outcome]] | None:
        """See `RunHooks.simulate_variant`."""
        ...

    def next_protocols(self) -> Mapping[str, StepProtocol]:
        """See `RunHooks.next_protocols`."""
        ...


@dataclass
class Spent:
    """Counts simulations as they finish."""

    budget: int
    simulations: int = 0
    seconds: float = 0.0
    unused: int = 0  # Simulations of the search that it did not make, which further records may take beside the budget.

    @property
    def left(self) -> int:
        """Simulations that may still be made."""
        return self.budget - self.simulations

    def counted(self, outcomes: Iterator[tuple[int, Outcome]], records: int) -> list[Outcome]:
        """The outcomes in the order of their candidates, each counted as so many simulations.

        A task counts as one simulation however many records it has, as in the search; every suggested record counts.
        """
        found: list[tuple[int, Outcome]] = []
        for place, outcome in outcomes:
            found.append((place, outcome))
            self.simulations += records
            self.seconds += outcome.seconds
        return in_order(found)
