"""Makes the time of a file rise."""

import numpy as np

from ..errors import BsaError
from ..trajectory import FloatArray
from .samples import Mask, Samples

BACKWARD_SHARE = 0.02
"""Rows whose clock runs back a little are left out up to this share of the record, or `BACKWARD_ROWS`."""

BACKWARD_ROWS = 5

DISORDER_SHARE = 0.1
"""A clock that falls in more than this share of the rows, and not to its beginning, is that of rows in another order
and not of several tests: each would have fewer rows than a record of a cell."""

RESTART_S = 60.0
"""A clock that runs back further than this (and ten usual intervals) has restarted, in s."""


_LISTED = 3


def usual_interval(time: FloatArray) -> float:
    """The median interval by which a clock rises, s; 0 where it never does."""
    spacing = np.diff(time)
    return float(np.median(spacing[spacing > 0])) if np.any(spacing > 0) else 0.0


def begins_anew(time: FloatArray) -> Mask:
    """Where a clock falls back to where the file begins, and goes on from there; shape (n - 1,).

    A test that was stopped within a minute falls back by less than `RESTART_S`. After a row that is out of order the
    clock is where it was, and one that is set back a little is not at its beginning.
    """
    usual = usual_interval(time)
    stays = np.append(time[2:] < time[:-2], False)
    return np.asarray((time[1:] <= time[0] + usual) & (np.diff(time) < -BACKWARD_ROWS * usual) & stays)


def check_order(samples: Samples) -> None:
    """Refuse rows that are not in the order of time. Raises `BsaError`.

    Of several tests, one behind the other, the clock falls once for each, and one that restarts with each step falls to
    its beginning.
    """
    time, falls = samples.time, np.diff(samples.time) < 0
    inside = falls & (time[1:] > np.min(time) + usual_interval(time))
    if np.any(np.diff(time) > 0) and np.count_nonzero(inside) > DISORDER_SHARE * len(samples):
        raise _runs_back(samples, int(np.count_nonzero(falls)))


def _runs_back(samples: Samples, count: int) -> BsaError:
    k = int(np.flatnonzero(np.diff(samples.time) < 0)[0]) + 1
    name = samples.column("time")
    return BsaError(
        f"{samples.source}: the time runs back in {count} of {len(samples)} rows, first in {samples.place(k)} "
        f"({samples.time[k - 1]:g} s, then {samples.time[k]:g} s): they are not in the order of time.",
        f"sort the rows by time (in pandas: .sort_values({name})), or say which column is the time with --column "
        "time=NAME; of several tests whose rows alternate, choose one with --where COLUMN=VALUE.",
    )


def with_clock(samples: Samples) -> Samples:
    """Make the time rise: lone spikes, repeated rows and small steps back are left out.

    Two samples may share a stamp where the current switches; both are kept.

    Raises `BsaError` if the clock restarts, or runs back too often.
    """
    spikes = np.zeros(len(samples), dtype=np.bool_)
    time = samples.time
    spikes[1:-1] = (time[1:-1] > time[2:]) & (time[2:] >= time[:-2])
    latest = np.maximum.accumulate(np.where(spikes, -np.inf, time))
    back = spikes | (time < latest)
    usual = usual_interval(time[~back])
    if usual == 0.0:
        raise _never_rises(samples)
    # The row before a restart is no lone spike: those lie high above both of their neighbours.
    far_back = np.diff(time) < -max(RESTART_S, 10.0 * usual)
    fallen = np.flatnonzero(~spikes[:-1] & (far_back | begins_anew(time))) + 1
    if len(fallen):
        k = int(fallen[0])
        raise BsaError(
            f"{samples.source}: the clock restarts in {samples.place(k)} ({time[k - 1]:g} s, then {time[k]:g} s).",
            f"it holds several tests: {choice_of(samples.tests_by)}, or say --join where they follow each other.",
        )
    if np.count_nonzero(back) > max(BACKWARD_ROWS, BACKWARD_SHARE * len(samples)):
        raise _runs_back(samples, int(np.count_nonzero(back)))
    return _without_repeats(samples.without(back, "out of time order"))


def choice_of(tests_by: tuple[str, ...] | None) -> str:
    """How to choose one of a file's tests, by the columns that tell them apart (`Samples.tests_by`)."""
    if tests_by:
        return f"choose one with --where {' or --where '.join(tests_by[:_LISTED])} (here the first)"
    if tests_by is None:
        return "choose one with --where COLUMN=VALUE"
    return "no column tells them apart, so cut the file there or add a column that numbers them (--where COLUMN=VALUE)"


def _never_rises(samples: Samples) -> BsaError:
    first, least = float(samples.time[0]), float(samples.time.min())
    name = samples.column("time")
    if least == first:
        hint = "say which column is the time with --column time=NAME."
        return BsaError(f"{samples.source}: column {name} never rises (it stays at {first:g} s).", hint)
    return BsaError(
        f"{samples.source}: column {name} never rises (it falls from {first:g} to {least:g} s).",
        "sort the rows by time, or say which column is the time with --column time=NAME.",
    )


def _without_repeats(samples: Samples) -> Samples:
    same = np.concatenate([[False], np.diff(samples.time) <= 0.0])
    if not same.any():
        return samples
    last_of_stamp = np.concatenate([~same[1:], [True]])
    scale = float(np.max(np.abs(samples.current)))
    first = np.maximum.accumulate(np.where(same, 0, np.arange(len(samples))))
    switches = np.abs(samples.current - samples.current[first]) > 0.02 * scale
    # Of the samples that share a stamp the first and, if the current has switched by then, the last are kept.
    keep = ~same | (last_of_stamp & switches)
    rows = np.flatnonzero(~keep)
    if len(rows) > 0.5 * len(samples):
        raise BsaError(
            f"{samples.source}: {len(rows)} of {len(samples)} rows repeat the time of the row before, first "
            f"{samples.place(int(rows[0]))} ({samples.time[rows[0]]:g} s).",
            "export the time with more digits.",
        )
    return samples.without(~keep, "with the time of the one before")
