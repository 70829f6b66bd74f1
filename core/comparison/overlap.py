"""A signal of a simulation against that of a record, over the time that both cover."""

import numpy as np

from ..task import Experiment
from ..trajectory import FloatArray, Trajectory

MOST_OF_THE_TIME = 0.99
"""Share of the time that a robust error covers, that of the smallest errors: the knee at the end of a discharge lasts
about a hundredth of it, and can hold most of the squared error."""

JUMP_S = 1e-6
"""Samples closer than this stand on the two sides of a jump."""


def scored_part(simulated: Trajectory | None, experiment: Experiment) -> Trajectory | None:
    """The part of a simulation that is compared; None if it was not reached."""
    if simulated is None or experiment.scored_cycle is None:
        return simulated
    return simulated.cycle(experiment.scored_cycle) if experiment.scored_cycle in simulated.cycles else None


def overlap_rms(simulated: Trajectory, target: Trajectory, signal: str, driven: bool, robust: bool = False) -> float:
    """Root mean square of simulated minus measured, weighted by time, in the signal's unit; see `differences`.

    If ``robust``, over the share `MOST_OF_THE_TIME` of the time with the smallest errors.
    """
    time, difference = differences(simulated, target, signal, driven)
    return (rms_without_worst if robust else weighted_rms)(time_weights(time), difference)


def differences(simulated: Trajectory, target: Trajectory, signal: str, driven: bool) -> tuple[FloatArray, FloatArray]:
    """Simulated minus measured over the time that both cover, each on its own clock from its first sample.

    ``driven``: measured signals drove the simulation. Gives seconds since the first sample, and the difference in the
    signal's unit, both of shape (k,).
    """
    ours, theirs = _without_ties(simulated.time), _without_ties(target.time)
    end = min(ours[-1], theirs[-1])
    # Under a measured drive both jump at the same instants, and the samples say all. Under a protocol
    # a jump comes a moment early or late; judged at sparse samples alone it would count for a whole interval.
    time = theirs[~target.inserted] if driven else np.union1d(ours, theirs)
    time = time[time <= end + JUMP_S]
    difference = np.interp(time, ours, simulated.values(signal)) - np.interp(time, theirs, target.values(signal))
    return time, difference


def time_weights(time: FloatArray) -> FloatArray:
    """The time that each sample stands for (trapezoidal rule), so that denser sampling does not count more, s.

    Ones where no time passes.
    """
    if len(time) < 2 or time[-1] <= time[0]:
        return np.ones(len(time))
    half = 0.5 * np.diff(time)
    return np.asarray(np.append(half, 0.0) + np.append(0.0, half))


def weighted_rms(weight: FloatArray, values: FloatArray) -> float:
    """Root of the weighted mean square."""
    return float(np.sqrt(np.sum(weight * values**2) / np.sum(weight)))


def rms_without_worst(weight: FloatArray, values: FloatArray) -> float:
    """Root of the weighted mean square of the share `MOST_OF_THE_TIME` of the weight with the smallest values."""
    order = np.argsort(np.abs(values), kind="stable")
    passed = np.cumsum(weight[order])
    kept = np.clip(MOST_OF_THE_TIME * passed[-1] - (passed - weight[order]), 0.0, weight[order])
    return weighted_rms(kept, values[order])


def _without_ties(time: FloatArray) -> FloatArray:
    """Time from zero, samples that share a stamp (the two sides of a jump) moved a microsecond apart."""
    time = time - time[0]
    tied = np.diff(time) <= JUMP_S
    time[:-1][tied] -= 0.5 * JUMP_S
    time[1:][tied] += 0.5 * JUMP_S
    return time
