"""How well a simulation matches a record, signal by signal: what every task has, whatever it is about."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..rms import rms
from ..signals import Signal
from ..simulation import Outcome
from ..task import Task
from .overlap import overlap_rms, scored_part
from .residuals import residuals


@dataclass(frozen=True)
class Metrics:
    """Errors of one trial."""

    objective: float  # The number that "best" means.

    def value(self, key: str) -> float:
        """An error by its name; NaN for one that the records do not have."""
        found = getattr(self, key)
        return math.nan if found is None else float(found)

    def as_json(self) -> dict[str, float | None]:
        """All errors by name; None for one that the records do not have."""
        return asdict(self)


@dataclass(frozen=True)
class Quantity:
    """An error as it is shown."""

    key: str  # Its name in `Metrics.as_json`.
    label: str  # Its name for people, at the beginning of a line.
    unit: str  # Unit in which it is shown.
    scale: float = 1.0  # How many shown units its value's unit is.
    told: str = ""  # Its name in a prompt, unit included.

    @property
    def words(self) -> str:
        """Its name within a sentence."""
        return self.label if self.label[:2].isupper() else self.label[:1].lower() + self.label[1:]

    @property
    def of_unit(self) -> str:
        """Unit and name, behind a number: ``"mV voltage RMSE"``."""
        return f"{self.unit} {self.words}".strip()

    def shown(self, metrics: Metrics | None) -> float | None:
        """Its value in the shown unit; None where there are no metrics, or not this one."""
        value = math.nan if metrics is None else metrics.value(self.key)
        return None if math.isnan(value) else self.scale * value


@dataclass(frozen=True)
class SignalMetrics(Metrics):
    """The misfit of all observed signals, and the error of each.

    The objective is the root mean square of the residuals, in tolerances: about 1 where the record is matched to its
    noise.
    """

    # Root-mean-square error of each observed signal over the time both records cover, by name, in its shown unit.
    rmse: Mapping[str, float]

    def value(self, key: str) -> float:
        """See `Metrics.value`."""
        return self.objective if key == MISFIT.key else self.rmse.get(key, math.nan)

    def as_json(self) -> dict[str, Any]:
        """See `Metrics.as_json`; flat, so that it is a line of a table."""
        return {"objective": self.objective, **self.rmse}

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> SignalMetrics:
        """The inverse of `as_json`."""
        return cls(content["objective"], {name: value for name, value in content.items() if name != "objective"})


def voltage_rmse_mv(metrics: Metrics) -> float:
    """The voltage error of a cell's trial, whichever signals it is judged by, mV; NaN where no voltage is."""
    return metrics.value("voltage_rmse_mv" if isinstance(metrics, SignalMetrics) else "v_rmse_mv")


MISFIT = Quantity("objective", "RMS misfit", "tolerances", told="rms_misfit_tolerances")


def evaluate_signals(task: Task, outcome: Outcome) -> SignalMetrics | None:
    """Compare an outcome with the task's targets. None if a simulation failed."""
    found = residuals(task, outcome)
    if found is None:
        return None
    squares: dict[str, list[float]] = {quantity.key: [] for quantity in signal_errors(task)}
    for experiment, run in zip(task.experiments, outcome.runs, strict=True):
        simulated = scored_part(run.trajectory, experiment)
        if simulated is None:
            return None
        for quantity, signal in zip(signal_errors(task), _judged(task), strict=True):
            if signal.name not in experiment.target.signals:
                continue
            error = overlap_rms(simulated, experiment.scored_target, signal.name, experiment.protocol is None)
            squares[quantity.key].append((signal.shown_scale * error) ** 2)
    rmse = {key: float(np.sqrt(np.mean(values))) for key, values in squares.items() if values}
    return SignalMetrics(rms(found), rmse)


def signal_errors(task: Task) -> tuple[Quantity, ...]:
    """The error of each observed signal that a record has, in the task's order."""
    return tuple(
        Quantity(name := f"{signal.name}_rmse_{signal.suffix}", f"{signal.title} RMSE", signal.shown, told=name)
        for signal in _judged(task)
    )


def _judged(task: Task) -> list[Signal]:
    return [s for s in task.observed if any(s.name in experiment.target.signals for experiment in task.experiments)]
