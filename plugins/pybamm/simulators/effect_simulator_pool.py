"""The simulator of a discovery on records in worker processes."""

import pickle
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from ....core.contracts.requests import MeasuredRecord, Prediction, Request
from ....core.target import Target
from ....core.task import CellModel
from ..modelling.resolution import Resolution
from .effect_simulator import CHEAPER, EffectSimulator
from .request_pool import RequestPool, RequestService

_TIME_LIMIT_S = 120.0
"""Longest time for one simulation, s. Twenty cycles with a layer that grows take ten; what crawls on has failed."""

_LARGE = ("measured_record", "moments")
"""Parts of a request that are sent as files, which a worker reads once."""


class EffectService(RequestService):
    """What each worker does; see `EffectSimulator`."""

    def request(self, job: Request) -> Request:
        """See `RequestService.request`."""
        return replace(job, **{name: _read(getattr(job, name)) for name in _LARGE})


@cache
def _read(path: Path) -> Any:
    """What a file holds; one object for all that ask, or its model would be compiled twice."""
    return pickle.loads(path.read_bytes())


def _simulator(
    cell: CellModel, targets: Mapping[str, Target], usual: Resolution, fine: Resolution, together: Sequence[Path]
) -> EffectSimulator:
    return EffectSimulator(cell, targets, usual, fine, [_read(path) for path in together])


class EffectSimulatorPool(RequestPool[Request, Prediction]):
    """Predicts measured records in worker processes; see `Simulator` and `EffectSimulator`."""

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
        make = partial(_simulator, cell, dict(targets), usual, fine, files)
        super().__init__(EffectService(make), workers, _TIME_LIMIT_S)
        self.has_low_fidelity = cell.model in CHEAPER

    def _job(self, request: Request) -> Any:
        files: dict[str, Any] = {name: self._file(getattr(request, name)) for name in _LARGE}
        return replace(super()._job(request), **files)

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
