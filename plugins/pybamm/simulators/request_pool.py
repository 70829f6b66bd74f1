"""A discovery's simulator in worker processes: what does not depend on one another is simulated side by side."""

import pickle
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Generic, TypeVar

from ....core.contracts.requests import AnyRequest
from ....core.errors import BsaError
from .processes import Pool, Report

Given = TypeVar("Given")


_Answer = tuple[Given | None, dict[str, str]]
"""What was simulated, and what the worker's simulator refused to build, by the effects' names."""


class RequestService:
    """Answers requests with a simulator of its own, which ``make`` gives in the worker; see `Service`."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make
        self._simulator: Any = None

    def request(self, job: Any) -> Any:
        """What was asked for, from what was sent."""
        return job

    def prepare(self) -> None:
        """Import PyBaMM."""
        from ..cells.parameter_sets import pybamm

        pybamm.set_logging_level("CRITICAL")
        self._simulator = self._make()

    def work(self, job: Any, report: Report) -> _Answer[Any]:
        """Answer a request."""
        (given,) = self._simulator.predict([self.request(job)])
        return given, dict(self._simulator.refused)

    def lost(self, cause: str, seconds: float, reported: Any) -> _Answer[Any]:
        """A request that could not be answered."""
        return None, {}


class RequestPool(Generic[AnyRequest, Given]):
    """Simulates in worker processes, each request with a time limit, s; see `Answering`."""

    has_low_fidelity = False
    recalled = 0  # Every request is simulated.

    def __init__(self, service: RequestService, workers: int, time_limit_s: float) -> None:
        self._lock = threading.Lock()
        self._pool: Pool[Any, _Answer[Given]] = Pool(service, workers, time_limit_s)
        self.at_once = workers
        self.refused: dict[str, str] = {}  # Effects that PyBaMM could not build, and why.
        self.simulations = 0

    def predict(self, requests: Sequence[AnyRequest]) -> list[Given | None]:
        """Simulate side by side; see `Answering.predict`.

        Raises `BsaError` if an effect cannot be sent to another process.
        """
        with self._lock:
            jobs = [self._job(request) for request in requests]
            self.simulations += len(jobs)
        answers: dict[int, Given | None] = {}
        try:
            for place, (given, refused) in self._pool.run(jobs):
                answers[place] = given
                self.refused.update(refused)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            names = sorted({effect.key for request in requests for effect in request.effects})
            raise BsaError(
                f"the effects {', '.join(names)} cannot be sent to a worker process: {error}.",
                "write their functions at the top level of a module, not as lambdas or inside other functions.",
            ) from None
        return [answers[place] for place in range(len(jobs))]

    def _job(self, request: AnyRequest) -> Any:
        """The request as it is sent."""
        # Whether records can show an effect was asked before; the function that says so need not be sent.
        effects = tuple(replace(effect, lacks=None) for effect in request.effects)
        return replace(request, effects=effects)

    def close(self) -> None:
        """End all processes."""
        self._pool.close()
