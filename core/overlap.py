"""A signal of a simulation against that of a record, over the time that both cover."""

from __future__ import annotations

import numpy as np

from .task import Experiment
from .trajectory import FloatArray, Trajectory

JUMP_S = 1e-6
"""Samples closer than this stand on the two sides of a jump."""


def scored_part(simulated: Trajectory | None, experiment: Experiment) -> Trajectory | None:
    """The part of a simulation that is compared; None if it was not reached."""
    if simulated is None or experiment.scored_cycle is None:
        return simulated
    return simulated.cycle(experiment.scored_cycle) if experiment.scored_cycle in simulated.cycles else None


def overlap_rms(simulated: Trajectory, target: Trajectory, signal: str, driven: bool) -> float:
    """Root mean square of simulated minus measured, weighted by time, in the signal's unit.

    Parameters
    ----------
    simulated, target : Trajectory
        The scored parts.
    signal : str
        Name of the signal.
    driven : bool
        Whether measured signals drove the simulation.
    """
    ours, theirs = _without_ties(simulated.time), _without_ties(target.time)
    end = min(ours[-1], theirs[-1])
    # Under a measured drive both jump at the same instants, and the samples say all. Under a protocol
    # a jump comes a moment early or late; judged at sparse samples alone it would count for a whole interval.
    time = theirs if driven else np.union1d(ours, theirs)
    time = time[time <= end + JUMP_S]
    difference = np.interp(time, ours, simulated.values(signal)) - np.interp(time, theirs, target.values(signal))
    return _time_weighted_rms(time, difference)


def _without_ties(time: FloatArray) -> FloatArray:
    """Time from zero, samples that share a stamp (the two sides of a jump) moved a microsecond apart."""
    time = time - time[0]
    tied = np.diff(time) <= JUMP_S
    time[:-1][tied] -= 0.5 * JUMP_S
    time[1:][tied] += 0.5 * JUMP_S
    return time


def _time_weighted_rms(time: FloatArray, values: FloatArray) -> float:
    """Root mean square over time, so that denser sampling does not count more."""
    if len(time) < 2 or time[-1] <= time[0]:
        return float(np.sqrt(np.mean(values**2)))
    return float(np.sqrt(np.trapezoid(values**2, time) / (time[-1] - time[0])))
