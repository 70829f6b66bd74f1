"""The simulator of a discovery on records in worker processes."""

from __future__ import annotations

import pickle
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...core.discovery.simulator import MeasuredRecord, Prediction, Request
from ...core.effect import Effect
from ...core.parameters import Candidate
from ...core.target import Target
from ...core.task import CellModel
from .effect_simulator import EffectSimulator, has_low_fidelity
from .request_pool import RequestPool, RequestService, sendable
from .resolution import Resolution

_TIME_LIMIT_S = 120.0
"""Longest time for one simulation, s. Twenty cycles with a layer that grows take ten; what crawls on has failed."""


@dataclass(frozen=True)
class _Job:
    """A request whose record and moments, which are large, lie in files that a worker reads once."""

    effects: tuple[Effect, ...]
    candidate: Candidate
    measured_record: Path
    moments: Path
    fine: bool
    soc: float | None
    low_fidelity: bool


class EffectService(RequestService):
    """What each worker does.

    Parameters
    ----------
    cell, targets, usual, fine
        As for `EffectSimulator`.
    """

    def __init__(
        self,
        cell: CellModel,
        targets: Mapping[str, Target],
        usual: Resolution,
        fine: Resolution,
        together: Sequence[Path] = (),
    ) -> None:
        self._arguments = (cell, dict(targets), usual, fine)
        self._together = tuple(together)
        self._read: dict[Path, Any] = {}

    def simulator(self) -> EffectSimulator:
        """See `RequestService.simulator`."""
        return EffectSimulator(*self._arguments, [self._thing(path) for path in self._together])

    def request(self, job: _Job) -> Request:
        """See `RequestService.request`."""
        measured_record, moments = self._thing(job.measured_record), self._thing(job.moments)
        return Request(job.effects, job.candidate, measured_record, moments, job.fine, job.soc, job.low_fidelity)

    def _thing(self, path: Path) -> Any:
        # What is asked for twice must be one object, or its model would be compiled twice.
        if path not in self._read:
            self._read[path] = pickle.loads(path.read_bytes())
        return self._read[path]


class EffectSimulatorPool(RequestPool[Request, Prediction]):
    """Predicts measured records; see `Simulator`.

    Parameters
    ----------
    cell, targets, usual, fine
        As for `EffectSimulator`.
    """

    def __init__(
        self,
        cell: CellModel,
        targets: Mapping[str, Target],
        usual: Resolution,
        fine: Resolution,
        workers: int,
        together: Sequence[MeasuredRecord] = (),
    ) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="bsa-")
        self._kept: dict[int, tuple[Any, Path]] = {}
        files = [self._file(record) for record in together]
        super().__init__(EffectService(cell, targets, usual, fine, files), workers, _TIME_LIMIT_S)
        self.has_low_fidelity = has_low_fidelity(cell)

    def _job(self, request: Request) -> _Job:
        measured_record, moments = self._file(request.measured_record), self._file(request.moments)
        asked = request.fine, request.soc, request.low_fidelity
        return _Job(sendable(request.effects), dict(request.candidate), measured_record, moments, *asked)

    def _file(self, thing: Any) -> Path:
        """The file of an object, which is kept so that its identity stays its own."""
        if id(thing) not in self._kept:
            path = Path(self._folder.name, f"{len(self._kept)}.pickle")
            path.write_bytes(pickle.dumps(thing))
            self._kept[id(thing)] = (thing, path)
        return self._kept[id(thing)][1]

    def close(self) -> None:
        """End all processes."""
        super().close()
        self._folder.cleanup()
