"""A simulator's low-fidelity model behind the journal: what it simulated is not simulated again when a run resumes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import InitVar, dataclass
from typing import Any

from ..comparison.residuals import residuals
from ..encoding import decode_array, encode_array
from ..parameters import Candidate
from ..task import Task
from ..trajectory import FloatArray
from .journal import Journal
from .listener import SILENT, Listener
from .run_plugins import RunPlugins

LOW_FIDELITY = "low-fidelity"
"""Event of the journal: the residuals of a candidate by the simulator's low-fidelity model."""

STEPS = "next step by the low-fidelity model"
"""What these simulations are for."""


@dataclass(eq=False)
class LowFidelitySimulations:
    """Residuals of candidates by a low-fidelity model; see `ProposeContext.low_fidelity`."""

    task: Task
    plugins: RunPlugins
    journal: Journal
    earlier: InitVar[Iterable[Mapping[str, Any]]] = ()  # The events of the interrupted run, if any.
    listener: Listener = SILENT  # Is told how many of a batch are done.

    def __post_init__(self, earlier: Iterable[Mapping[str, Any]]) -> None:
        self._known: dict[tuple[tuple[str, float], ...], FloatArray | None] = {}
        self.exists = self.plugins.simulate_low_fidelity([]) is not None
        """Whether the simulator has such a model of the task."""
        self.seconds = 0.0
        """Time of all these simulations, those side by side added up, s."""
        for event in earlier:
            if event["event"] == LOW_FIDELITY:
                found = event["residuals"]
                self._take(event["candidate"], None if found is None else decode_array(found), event["seconds"])

    @property
    def simulations(self) -> int:
        """How many of these simulations were made."""
        return len(self._known)

    def __call__(self, candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        """The residuals of each, shape (m,); None for one that failed."""
        keys = [_key(candidate) for candidate in candidates]
        places = [place for place, key in enumerate(keys) if key not in self._known]
        if places:
            self.listener.counted(STEPS, 0, len(places))
        outcomes = self.plugins.simulate_low_fidelity([candidates[place] for place in places]) if places else ()
        for done, (number, outcome) in enumerate(outcomes or (), start=1):
            candidate, found = candidates[places[number]], residuals(self.task, outcome)
            packed = None if found is None else encode_array(found)
            self.journal.append(LOW_FIDELITY, candidate=dict(candidate), residuals=packed, seconds=outcome.seconds)
            self._take(candidate, found, outcome.seconds)
            self.listener.counted(STEPS, done, len(places))
        return [self._known[key] for key in keys]

    def _take(self, candidate: Candidate, found: FloatArray | None, seconds: float) -> None:
        self._known[_key(candidate)] = found
        self.seconds += seconds


def _key(candidate: Candidate) -> tuple[tuple[str, float], ...]:
    return tuple(sorted(candidate.items()))
