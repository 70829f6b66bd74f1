"""Lays a simulation over a target step by step, each step on its own clock.

Absolute time misleads: a step that ends a minute early shifts everything after it. Compared at equal
fractions of its own duration, a step's curve and its duration are smooth functions of the parameters.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..signals import Signal
from ..task import Experiment
from ..trajectory import FloatArray, Step, Trajectory


@dataclass(frozen=True, eq=False)
class StepPair:
    """One step of the target beside its counterpart."""

    step: Step  # The target's step.
    measured: Trajectory  # The target's samples of the step.
    simulated: Trajectory | None  # The simulation's samples; None if the step vanished or was never reached.
    name: str  # ``"CC charge"``, with a number where the kind occurs more than once (``"rest 2"``).
    # The simulated signals where the step before left them, for a step without samples of its own in a cycle that was
    # begun; None otherwise.
    fallback: Mapping[str, float] | None

    @property
    def duration_s(self) -> tuple[float, float]:
        """Measured and simulated duration in seconds; 0 for a vanished step."""
        return self.measured.duration, self.simulated.duration if self.simulated is not None else 0.0

    @property
    def reached(self) -> bool:
        """Whether there are simulated values to compare: of the step, or of where the step before left the signals.

        Whether the simulation got that far, `ExperimentRun.failure` says.
        """
        return self.simulated is not None or self.fallback is not None

    def curves(self, signal: Signal, fractions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A signal, measured and simulated, at fractions (0 to 1) of each step's own duration.

        They are compared where samples were taken, and their difference is linear in between, and constant before the
        first sample and behind the last: it changes slowly where the signals do not. A cell that rests relaxes by tens
        of millivolts before a cycler writes its first sample, and a straight line through the samples knows nothing of
        that. In a vanished step an observed signal stays where it was, and nothing is driven.
        """
        simulated, sampled = self._simulated(signal, fractions), self.sampled
        difference = self._simulated(signal, sampled) - self.sampled_values(signal)
        return simulated - np.interp(fractions, sampled, difference), simulated

    def kept_of_noise(self, fractions: FloatArray) -> FloatArray:
        """Deviation of means of a mismatch in units of that of one sample's noise, which is independent of the others'.

        ``fractions``, of shape (n, k), are where the mismatches stand that are averaged to n means; shape (n,).
        """
        _, sampled = self._taken
        if len(sampled) < 2:
            return np.ones(len(fractions))
        right = np.clip(np.searchsorted(sampled, fractions), 1, len(sampled) - 1)
        gaps = np.maximum(sampled[right] - sampled[right - 1], 1e-12)
        share = np.clip((fractions - sampled[right - 1]) / gaps, 0.0, 1.0)
        rows = np.arange(len(fractions))[:, None] * len(sampled)
        places = np.stack([rows + right - 1, rows + right]).ravel()
        weights = np.stack([1.0 - share, share]).ravel() / fractions.shape[1]
        met, which = np.unique(places, return_inverse=True)
        squares = np.bincount(which, weights) ** 2
        return np.sqrt(np.bincount(met // len(sampled), squares, minlength=len(fractions)))

    @property
    def sampled(self) -> FloatArray:
        """The fractions of the measured duration at which samples were taken, in order."""
        return self._taken[1]

    def sampled_values(self, signal: Signal) -> FloatArray:
        """The measured signal at `sampled`."""
        return self.measured.values(signal.name)[self._taken[0]]

    @property
    def _taken(self) -> tuple[NDArray[np.intp], FloatArray]:
        """Places of the samples that were taken, and the fractions of the step's duration at which they were."""
        measured = self.measured
        taken = np.flatnonzero(~measured.inserted) if not np.all(measured.inserted) else np.arange(len(measured))
        return taken, (measured.time[taken] - measured.time[0]) / (measured.duration or 1.0)

    def _simulated(self, signal: Signal, fractions: FloatArray) -> FloatArray:
        if self.simulated is not None:
            return at_fractions(self.simulated, self.simulated.values(signal.name), fractions)
        stays = (self.fallback or {}).get(signal.name, np.nan) if signal.role == "observed" else 0.0
        return np.full_like(fractions, stays)


def at_fractions(piece: Trajectory, signal: FloatArray, fractions: FloatArray) -> FloatArray:
    """A signal of one step at fractions of the step's duration, shape of ``fractions``."""
    if len(piece) == 1 or piece.duration <= 0:
        return np.full_like(fractions, signal[-1])
    return np.asarray(np.interp(piece.time[0] + fractions * piece.duration, piece.time, signal), dtype=np.float64)


def pair_steps(simulated: Trajectory | None, experiment: Experiment) -> list[StepPair]:
    """Match the scored steps of the target with those of the simulation.

    Steps are matched by cycle and place in the protocol, so that a step which a candidate makes vanish does not shift
    the ones behind it. Where the places are of steps of other kinds, as the record has steps that its protocol lacks,
    they are matched by cycle, kind and occurrence (the second rest with the second rest).
    """
    wanted = [step for step in experiment.target.steps if experiment.scored_cycle in (None, step.cycle)]
    found: dict[tuple[int, str, int], Step] = {}
    key_of = _keys
    reached_cycle = 0
    fallback: dict[str, float] | None = None
    if simulated is not None and simulated.steps:
        key_of = _places if _share_places(wanted, simulated.steps) else _keys
        found = dict(zip(key_of(simulated.steps), simulated.steps, strict=True))
        reached_cycle = simulated.steps[-1].cycle
        fallback = _before_cycle(simulated, wanted[0].cycle) if wanted else None
    totals = Counter((step.cycle, step.kind) for step in wanted)
    pairs: list[StepPair] = []
    for step, key, (cycle, kind, occurrence) in zip(wanted, key_of(wanted), _keys(wanted), strict=True):
        name = str(kind) if totals[cycle, kind] == 1 else f"{kind} {occurrence}"
        if experiment.scored_cycle is None and len(experiment.target.cycles) > 1:
            name = f"cycle {cycle} {name}"
        counterpart = found.get(key)
        piece = None
        if counterpart is not None and simulated is not None:
            piece = simulated.slice(counterpart.start, counterpart.stop)
            fallback = {signal: float(values[-1]) for signal, values in piece.signals.items()}
        measured = experiment.target.slice(step.start, step.stop)
        pairs.append(StepPair(step, measured, piece, name, fallback if cycle <= reached_cycle else None))
    return pairs


def _before_cycle(simulated: Trajectory, cycle: int) -> dict[str, float]:
    """The signals where a simulation stands before the first step of a cycle: at its own start where none is before."""
    before = [step for step in simulated.steps if step.cycle < cycle]
    place = before[-1].stop - 1 if before else simulated.steps[0].start
    return {signal: float(values[place]) for signal, values in simulated.signals.items()}


def _share_places(wanted: Sequence[Step], simulated: Sequence[Step]) -> bool:
    """Whether steps at the same place of a cycle are of the same kind, and no two steps have one place."""
    kinds = {(step.cycle, step.position): step.kind for step in simulated}
    own = {(step.cycle, step.position): step.kind for step in wanted}
    distinct = len(kinds) == len(simulated) and len(own) == len(wanted)
    return distinct and all(kinds.get(place, kind) == kind for place, kind in own.items())


def _places(steps: Sequence[Step]) -> list[tuple[int, str, int]]:
    return [(step.cycle, step.kind, step.position) for step in steps]


def _keys(steps: Sequence[Step]) -> list[tuple[int, str, int]]:
    counts: Counter[tuple[int, str]] = Counter()
    keys: list[tuple[int, str, int]] = []
    for step in steps:
        counts[step.cycle, step.kind] += 1
        keys.append((step.cycle, step.kind, counts[step.cycle, step.kind]))
    return keys
