"""Where the time of a run goes, round by round."""

import time
from dataclasses import dataclass

from ...core.messages import Usage
from ...core.proposal import Proposal
from ...core.trial import Phase, Trial


@dataclass(frozen=True)
class RoundTime:
    """One round of the search."""

    proposer_s: float  # From the last simulation's end to the proposal, the model's time included.
    backend_s: float  # Of it, in the model.
    round_s: float  # Wall time of the whole round.
    simulations: int  # Simulations of the round.


class Stopwatch:
    """A listener that reads the clock when proposals and trials come by.

    ``resumed``: the run was begun by an earlier process, whose times are not known.
    """

    def __init__(self, resumed: bool = False) -> None:
        self.resumed = resumed
        self.proposer_s = 0.0
        self.rounds: list[RoundTime] = []
        self._searching = False
        self._backend_s = 0.0
        self._last = time.perf_counter()

    def _lap(self) -> float:
        now = time.perf_counter()
        spent, self._last = now - self._last, now
        return spent

    def proposed(self, proposal: Proposal, phase: Phase, number: int) -> None:
        """See `Listener.proposed`."""
        spent = self._lap()
        self.proposer_s += spent
        self._searching = phase == "search"
        if self._searching:
            self.rounds.append(RoundTime(spent, 0.0, spent, 0))

    def tried(self, trial: Trial, best: Trial, usage: Usage) -> None:
        """See `Listener.tried`."""
        spent = self._lap()
        backend_s, self._backend_s = usage.seconds - self._backend_s, usage.seconds
        if self._searching:
            last = self.rounds[-1]
            self.rounds[-1] = RoundTime(
                last.proposer_s, last.backend_s + backend_s, last.round_s + spent, last.simulations + 1
            )

    def counted(self, purpose: str, done: int, total: int) -> None:
        """See `Listener.counted`."""

    def noted(self, text: str) -> None:
        """See `Listener.noted`."""
