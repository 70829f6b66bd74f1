"""A simulator that writes every answer into the journal, and on resume answers from it first."""

import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any, Generic, TypeVar

from ..contracts.requests import Answering, AnyRequest
from ..encoding import decode_array, encode_array
from ..errors import BsaError
from .journal import Journal
from .run_config import hash_of

SIMULATION, REFUSED = "simulation", "refused"


Given = TypeVar("Given")


class RecordedSimulator(Generic[AnyRequest, Given]):
    """Stands between a discovery and what simulates for it; see `Answering`.

    A discovery is a function of its simulations. One that is carried out anew with those of the journal comes to the
    place where it was stopped without a simulation, and goes on from there. ``answer`` is the dataclass of the answers:
    its fields are arrays, of which only later ones may be None. ``counted`` hears how many were simulated each time.
    """

    def __init__(
        self,
        inner: Answering[AnyRequest, Given],
        answer: type[Given],
        journal: Journal,
        earlier: Iterable[Mapping[str, Any]] = (),
        counted: Callable[[int], None] = lambda count: None,
    ) -> None:
        self._inner: Answering[AnyRequest, Given] = inner
        self._counted = counted
        self._answer = answer
        self._journal = journal
        earlier = list(earlier)
        self._known = {event["key"]: self._decoded(event) for event in earlier if event["event"] == SIMULATION}
        self.refused: dict[str, str] = {event["effect"]: event["why"] for event in earlier if event["event"] == REFUSED}
        self._lock = threading.Lock()
        self.at_once, self.has_low_fidelity = inner.at_once, inner.has_low_fidelity
        self.simulations = self.recalled = 0

    def predict(self, requests: Sequence[AnyRequest]) -> list[Given | None]:
        """Answer from the journal, and have the rest simulated side by side."""
        keys = [hash_of(request.identity, 24) for request in requests]
        with self._lock:
            self.simulations += len(requests)
            missing = {key: request for key, request in zip(keys, requests, strict=True) if key not in self._known}
            self.recalled += sum(key not in missing for key in keys)
        if missing:
            found = self._inner.predict(list(missing.values()))
            with self._lock:
                wall_s = self._journal.open_s
                for key, answer in zip(missing, found, strict=True):
                    self._known[key] = answer
                    self._journal.append(SIMULATION, key=key, wall_s=wall_s, **self._encoded(answer))
                for effect in self._inner.refused.keys() - self.refused.keys():
                    self.refused[effect] = self._inner.refused[effect]
                    self._journal.append(REFUSED, effect=effect, why=self.refused[effect])
            self._counted(len(missing))
        return [self._known[key] for key in keys]

    @property
    def _arrays(self) -> list[str]:
        return [field.name for field in fields(self._answer)]  # type: ignore[arg-type]

    def _encoded(self, answer: Given | None) -> dict[str, str | None]:
        if answer is None:
            return {self._arrays[0]: None}
        values = {name: getattr(answer, name) for name in self._arrays}
        return {name: None if value is None else encode_array(value) for name, value in values.items()}

    def _decoded(self, event: Mapping[str, Any]) -> Given | None:
        first = self._arrays[0]
        if first not in event:
            raise BsaError(f"a simulation in {self._journal.path} has no {first}.", "start a new discovery.")
        if event[first] is None:
            return None
        packed = {name: event.get(name) for name in self._arrays}
        return self._answer(**{name: None if text is None else decode_array(text) for name, text in packed.items()})
