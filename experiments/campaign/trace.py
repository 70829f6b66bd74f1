"""The simulations and rounds of a cell with their times, as ``trace.json`` keeps them beside its journal."""

import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from ...core.errors import BsaError
from ...core.files import read_json
from ...core.messages import Usage
from ...core.proposal import Proposal
from ...core.run.journal import read_events
from ...core.run.listener import Listener
from ...core.shape import shaped
from ...core.trial import Phase, Trial
from .store import TRACE


@dataclass
class RoundTime:
    """One round of the search."""

    proposer_s: float  # From the last simulation's end to the proposal, the model's time included.
    backend_s: float  # Of it, in the model.
    round_s: float  # Wall time of the whole round.
    simulations: int  # Simulations of the round.


@dataclass(frozen=True)
class Trace:
    """What tables and figures need of every simulation and round, so that they need not read journals of megabytes."""

    objective: list[float | None] = field(default_factory=list)  # Of every simulation, in order; None for a failed one.
    phase: str = ""  # First letters of the simulations' phases: initial, warm-up, search.
    # Times round by round; none of a run that was taken up again.
    rounds: list[RoundTime] = field(default_factory=list)
    proposer_s: float | None = None  # Time of the proposer without its language model.
    resumed: bool = False  # Whether the run was taken up again; its times are of the last part.
    run_s: float = 0.0  # Wall time of the run in its process.

    def best_after(self, simulations: int) -> float | None:
        """Least objective among the first simulations; None where none succeeded."""
        return min((value for value in self.objective[:simulations] if value is not None), default=None)

    def best_before_search(self) -> float | None:
        """Least objective of the start and the warm-up; None where none succeeded."""
        return self.best_after(len(self.phase.rstrip("s")))

    @property
    def improved(self) -> bool:
        """Whether the search got below the best of start and warm-up, both as the run itself simulated them."""
        found, before = self.best_after(len(self.objective)), self.best_before_search()
        return found is not None and (before is None or found < before)


class Stopwatch(Listener):
    """A listener that reads the clock when proposals and trials come by."""

    def __init__(self) -> None:
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
            last.backend_s += backend_s
            last.round_s += spent
            last.simulations += 1


def read_trace(folder: Path) -> Trace:
    """The trace of a cell; from its journal where a run was killed before it wrote one, or ``bsa run`` made it."""
    with suppress(ValueError):
        found: Trace = shaped(Trace, read_json(folder / TRACE))
        if found.phase:
            return found
    try:
        trials = {event["index"]: event for event in read_events(folder) if event["event"] == "trial"}
    except BsaError:
        return Trace()  # nothing is known but the result
    ordered = [trials[index] for index in sorted(trials)]
    good = [event["failure"] is None and event["metrics"] is not None for event in ordered]
    return Trace(
        [event["metrics"]["objective"] if ok else None for event, ok in zip(ordered, good, strict=True)],
        "".join(event["phase"][0] for event in ordered),
    )
