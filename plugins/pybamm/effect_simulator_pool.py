"""A simulator in worker processes: requests that do not depend on one another are simulated side by side."""

from __future__ import annotations

import pickle
import tempfile
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...core.discovery.simulator import MeasuredRecord, Prediction, Request
from ...core.effect import Effect
from ...core.errors import BsaError
from ...core.parameters import Candidate
from ...core.target import Target
from ...core.task import CellModel
from .effect_simulator import has_low_fidelity
from .processes import Pool, Report
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


@dataclass(frozen=True)
class _Answer:
    """A prediction, and what the worker's simulator refused to build, by the effects' names."""

    prediction: Prediction | None
    refused: Mapping[str, str]


class RequestService:
    """Answers requests with a simulator of its own; see `Service`.

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
        self._simulator: Any = None
        self._read: dict[Path, Any] = {}

    def prepare(self) -> None:
        """Import PyBaMM; models are compiled when they are first asked for."""
        from .effect_simulator import EffectSimulator
        from .parameter_sets import pybamm

        pybamm.set_logging_level("CRITICAL")
        self._simulator = EffectSimulator(*self._arguments, [self._thing(path) for path in self._together])

    def work(self, job: _Job, report: Report) -> _Answer:
        """Answer a request."""
        measured_record, moments = self._thing(job.measured_record), self._thing(job.moments)
        request = Request(job.effects, job.candidate, measured_record, moments, job.fine, job.soc, job.low_fidelity)
        (prediction,) = self._simulator.predict([request])
        return _Answer(prediction, dict(self._simulator.refused))

    def _thing(self, path: Path) -> Any:
        # What is asked for twice must be one object, or its model would be compiled twice.
        if path not in self._read:
            self._read[path] = pickle.loads(path.read_bytes())
        return self._read[path]

    def lost(self, cause: str, seconds: float, reported: Any) -> _Answer:
        """A request that could not be answered."""
        return _Answer(None, {})


class EffectSimulatorPool:
    """Simulates in worker processes with a time limit; see `Simulator`.

    Parameters
    ----------
    cell, targets, usual, fine
        As for `EffectSimulator`.

    Attributes
    ----------
    refused : dict of str to str
        Effects that PyBaMM could not build, and why.
    simulations : int
        Requests that were simulated.
    at_once : int
        The number of workers.
    recalled : int
        0: every request is simulated.
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
        self._lock = threading.Lock()
        self.at_once, self.has_low_fidelity = workers, has_low_fidelity(cell)
        self.recalled = 0
        self._folder = tempfile.TemporaryDirectory(prefix="bsa-")
        self._kept: dict[int, tuple[Any, Path]] = {}
        files = [self._file(record) for record in together]
        self._pool = Pool(RequestService(cell, targets, usual, fine, files), workers, _TIME_LIMIT_S)
        self.refused: dict[str, str] = {}
        self.simulations = 0

    def predict(self, requests: Sequence[Request]) -> list[Prediction | None]:
        """Simulate side by side; see `Simulator.predict`.

        Raises `BsaError` if an effect cannot be sent to another process.
        """
        with self._lock:
            jobs = [self._job(request) for request in requests]
            self.simulations += len(jobs)
        answers: dict[int, _Answer] = {}
        try:
            for place, answer in self._pool.run(jobs):
                answers[place] = answer
                self.refused.update(answer.refused)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            names = sorted({effect.key for request in requests for effect in request.effects})
            raise BsaError(
                f"the effects {', '.join(names)} cannot be sent to a worker process: {error}.",
                "write their functions at the top level of a module, not as lambdas or inside other functions.",
            ) from None
        return [answers[place].prediction for place in range(len(jobs))]

    def _job(self, request: Request) -> _Job:
        measured_record, moments = self._file(request.measured_record), self._file(request.moments)
        # Whether records can show an effect was asked before; the function that says so need not be sent.
        effects = tuple(replace(effect, lacks=None) for effect in request.effects)
        asked = request.fine, request.soc, request.low_fidelity
        return _Job(effects, dict(request.candidate), measured_record, moments, *asked)

    def _file(self, thing: Any) -> Path:
        """The file of an object, which is kept so that its identity stays its own."""
        if id(thing) not in self._kept:
            path = Path(self._folder.name, f"{len(self._kept)}.pickle")
            path.write_bytes(pickle.dumps(thing))
            self._kept[id(thing)] = (thing, path)
        return self._kept[id(thing)][1]

    def close(self) -> None:
        """End all processes."""
        self._pool.close()
        self._folder.cleanup()
