"""A simulator that writes every prediction into the journal, and on resume answers from it first."""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..encoding import decode_array, encode_array
from ..journal import Journal
from .simulator import Prediction, Request, Simulator

SIMULATION, REFUSED = "simulation", "refused"


class RecordedSimulator:
    """Stands between a discovery and what simulates for it; see `Simulator`.

    A discovery is a function of its predictions. One that is carried out anew with those of the journal comes to
    the place where it was stopped without a simulation, and goes on from there.
    """

    def __init__(self, inner: Simulator, journal: Journal, earlier: Iterable[Mapping[str, Any]] = ()) -> None:
        self._inner = inner
        self._journal = journal
        earlier = list(earlier)
        self._known = {event["key"]: _decoded(event) for event in earlier if event["event"] == SIMULATION}
        self.refused: dict[str, str] = {event["effect"]: event["why"] for event in earlier if event["event"] == REFUSED}
        self._lock = threading.Lock()
        self.at_once, self.has_low_fidelity = inner.at_once, inner.has_low_fidelity
        self.simulations = self.recalled = 0

    def predict(self, requests: Sequence[Request]) -> list[Prediction | None]:
        """Answer from the journal, and have the rest simulated side by side."""
        keys = [_key(request) for request in requests]
        with self._lock:
            self.simulations += len(requests)
            missing = {key: request for key, request in zip(keys, requests, strict=True) if key not in self._known}
            self.recalled += sum(key not in missing for key in keys)
        if missing:
            found = self._inner.predict(list(missing.values()))
            with self._lock:
                for key, prediction in zip(missing, found, strict=True):
                    self._known[key] = prediction
                    self._journal.append(SIMULATION, key=key, **_encoded(prediction))
                for effect in self._inner.refused.keys() - self.refused.keys():
                    self.refused[effect] = self._inner.refused[effect]
                    self._journal.append(REFUSED, effect=effect, why=self.refused[effect])
        return [self._known[key] for key in keys]


def _key(request: Request) -> str:
    """What tells a request from every other of the same discovery."""
    told: dict[str, Any] = {
        "effects": [effect.key for effect in request.effects],
        "candidate": {name: float(value) for name, value in request.candidate.items()},
        "record": [request.measured_record.name, len(request.measured_record.record)],
        "moments": [len(request.moments.time), float(request.moments.time.sum())],
        "fine": request.fine,
        "soc": None if request.soc is None else float(request.soc),
    }
    if request.low_fidelity:
        told["low_fidelity"] = True
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:24]


def _encoded(prediction: Prediction | None) -> dict[str, str | None]:
    if prediction is None:
        return {"voltage": None}
    kelvin = prediction.temperature
    return {
        "voltage": encode_array(prediction.voltage),
        "temperature": None if kelvin is None else encode_array(kelvin),
    }


def _decoded(event: Mapping[str, Any]) -> Prediction | None:
    if event["voltage"] is None:
        return None
    kelvin = event.get("temperature")
    return Prediction(decode_array(event["voltage"]), None if kelvin is None else decode_array(kelvin))
