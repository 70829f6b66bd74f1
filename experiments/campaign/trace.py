"""The simulations and rounds of a finished cell, as ``trace.json`` keeps them beside its journal."""

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from ...core.errors import BsaError
from ...core.files import read_json
from ...core.journal import read_events
from ...core.shape import shaped
from .stopwatch import RoundTime
from .store import TRACE


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
