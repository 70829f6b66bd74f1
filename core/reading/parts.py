"""The parts of a record between silences in which an unknown charge may have passed."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..record import Record
from ..trajectory import SECONDS_PER_HOUR, Step, Trajectory
from .checks import MIN_SAMPLES
from .gaps import FLOWS, gaps_in


def parts_between_gaps(record: Record) -> list[Record]:
    """The record, cut where it is silent for long beside a load, or while charge passed by the file's own counter.

    When a load beside a silence began or ended nobody wrote down, nor how the charge of a silence passed.

    A part that begins at rest has a state of charge of its own, and is a record of its own. One that begins under load,
    as the whole record may, shows no open-circuit voltage, and one of a few samples is no record; these are left out
    (but for the longest one, where no other is left), and the first part says so. The record itself where there is no
    such silence.
    """
    trajectory = record.trajectory
    loaded = np.abs(trajectory.current) > FLOWS * np.max(np.abs(trajectory.current), initial=0.0)
    gaps = gaps_in(trajectory)
    charged = np.isin(trajectory.time[gaps], record.charged_gaps_s)
    cuts = gaps[loaded[gaps] | loaded[gaps + 1] | charged] + 1
    if len(cuts) == 0:
        return [record]
    edges = list(pairwise([0, *map(int, cuts), len(trajectory)]))
    kept = [(a, b) for a, b in edges if b - a >= MIN_SAMPLES and (a == 0 or not loaded[a])]
    kept = kept or [max(edges, key=lambda edge: edge[1] - edge[0])]
    left_out_s = sum(float(np.ptp(trajectory.time[a:b])) for a, b in edges if (a, b) not in kept)
    note = (
        "it is silent for long beside a load, or while charge passed, so that what the cell went through is not known "
        f"(silences: {len(cuts)}); records that are used of it, each with its own state of charge: {len(kept)}"
    )
    if len(kept) < len(edges):
        hours = left_out_s / SECONDS_PER_HOUR
        note += f"; {hours:.3g} h that begin under load or have less than {MIN_SAMPLES} samples are left out"
    parts = [
        replace(record, name=f"{record.name}, part {number}", trajectory=_slice(trajectory, a, b), notes=())
        for number, (a, b) in enumerate(kept, start=1)
    ]
    first = parts[0] if len(parts) > 1 else replace(parts[0], name=record.name)
    return [replace(first, notes=(*record.notes, f"{note}.")), *parts[1:]]


def _slice(trajectory: Trajectory, start: int, stop: int) -> Trajectory:
    """Samples ``start`` to ``stop - 1`` with the steps that they touch."""
    steps: list[Step] = []
    for step in trajectory.steps:
        begin, end = max(step.start, start), min(step.stop, stop)
        if begin < end:
            steps.append(replace(step, start=begin - start, stop=end - start))
    return trajectory.picked(slice(start, stop), tuple(steps))
