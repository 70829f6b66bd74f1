"""The charge that a cycler's own counters saw pass, and when it switched the current between two samples."""

from dataclasses import replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from ..printable import rounded
from ..trajectory import SECONDS_PER_HOUR, FloatArray, drawn_between
from .gaps import gaps_in
from .samples import Counter, Samples

LATE_S = 5.0
"""Within a shorter interval a counter that disagrees is merely written a little later than the current, in s."""

_SWITCHED_SHARE = 0.02
"""Change of the current, as a share of the largest, that is a switch and no noise."""

_SHOWN_SHARE = 5e-4
"""Share of the record's charge by which a counter and the samples must differ in an interval: counters are written with
four or five digits."""

_SAME_TIME_S = 1e-6
"""A switch that is nearer to a sample is at the sample, s: less than the clock of a cycler resolves, more than what
differences of large counters leave of a switch that is exactly there."""


def counted_between(samples: Samples) -> FloatArray | None:
    """Charge drawn between neighbouring samples by the file's own counters.

    Of samples with a current positive on discharge. Shape (n - 1,), in A.h, NaN where a counter is missing; None
    without counters, or where a tenth of their values is missing.
    """
    extra = samples.extra
    if "charged_ah" in extra and "discharged_ah" in extra:
        passed = _rises(extra["discharged_ah"]) - _rises(extra["charged_ah"])
    elif "net_ah" in extra:
        passed, sampled = np.diff(extra["net_ah"]), _sampled(samples)
        # A net counter may run either way; in a long silence it may have been set to zero.
        passed *= np.sign(np.nansum(np.delete(passed * sampled, gaps_in(samples)))) or 1.0
        passed = np.where(np.abs(extra["net_ah"][1:]) < 1e-9, sampled, passed)  # set to zero, it says nothing
    else:
        return None
    return None if np.count_nonzero(np.isfinite(passed)) < 0.9 * len(passed) else passed


def _sampled(samples: Samples) -> FloatArray:
    """Charge drawn between neighbouring samples if the current were linear between them, A.h, shape (n - 1,)."""
    return drawn_between(samples.time, samples.current) / SECONDS_PER_HOUR


def _rises(counter: FloatArray) -> FloatArray:
    """Increments of a counter that rises and is set to zero now and then."""
    steps = np.diff(counter)
    return np.where(steps < 0, np.maximum(counter[1:], 0.0), steps)


def with_switches_counted(samples: Samples) -> Samples:
    """The samples with two more wherever the counters tell when the current was switched between two of them.

    Cyclers write a sample every few minutes of a rest: a discharge that ended right after its last sample would go on,
    falling to zero, until the next one. Where the counted charge lies between that of an immediate switch and that of
    the latest possible one, the current is constant up to the switch and after it. The voltage there is not known: the
    samples that are put in say that they were (`Samples.inserted`). Long silences are left as they are: more than one
    switch may have happened there. The current is positive on discharge and times rise. A note tells where anything was
    added.
    """
    passed = counted_between(samples)
    if passed is None or len(samples) < 2:
        return samples
    spacing, before, after = np.diff(samples.time), samples.current[:-1], samples.current[1:]
    sampled = _sampled(samples)
    size = min(float(np.ptp(np.cumsum(sampled))), float(np.ptp(np.nancumsum(passed))) or np.inf)
    switched = np.abs(after - before) > _SWITCHED_SHARE * float(np.max(np.abs(samples.current)))
    with np.errstate(divide="ignore", invalid="ignore"):
        # current before for `share` of the interval, current after for the rest of it
        share = (SECONDS_PER_HOUR * passed / spacing - after) / (before - after)
    slack = _SHOWN_SHARE * size / np.maximum(np.abs(before - after) * spacing / SECONDS_PER_HOUR, 1e-12)
    told = switched & (spacing > LATE_S) & (np.abs(passed - sampled) > _SHOWN_SHARE * size)
    told &= (share >= -slack) & (share <= 1.0 + slack)
    told[gaps_in(samples)] = False
    places = np.flatnonzero(told)
    if len(places) == 0:
        return samples
    widest, widest_s = samples.place(int(places[np.argmax(spacing[places])])), spacing[places].max()
    moved_ah = float(np.sum((passed - sampled)[places]))
    return _with_pairs(samples, places, np.clip(share[places], 0.0, 1.0)).noted(
        f"the current switches between samples far apart (places: {len(places)}; the widest, {rounded(widest_s, 3)} s, "
        f"after {widest}); when it did is taken from the file's own counter of charge: {moved_ah:+.3g} A.h drawn in "
        "all against a current that is linear between the samples."
    )


def _with_pairs(samples: Samples, places: NDArray[np.intp], share: FloatArray) -> Samples:
    """Two samples at one time after each of the places: the sample before and the one after, at the switch."""
    spacing = np.diff(samples.time)[places]
    late, early = share * spacing > _SAME_TIME_S, (1.0 - share) * spacing > _SAME_TIME_S
    at = samples.time[places] + share * spacing
    # A switch at one of the two samples needs one copy alone.
    into = np.concatenate([places[late], places[early]]) + 1
    copied = np.concatenate([places[late], places[early] + 1])
    order = np.argsort(into, kind="stable")
    index = np.insert(np.arange(len(samples)), into[order], copied[order])
    found = samples.kept(index)
    inserted = np.insert(samples.inserted, into[order], True)
    time = np.insert(samples.time, into[order], np.concatenate([at[late], at[early]])[order])
    extra = dict(found.extra)
    for name in set(extra) & set(get_args(Counter)):
        values = samples.extra[name]
        before, after = values[places], values[places + 1]
        current = np.abs(samples.current[places]) * share, np.abs(samples.current[places + 1]) * (1.0 - share)
        reached = before + (after - before) * current[0] / np.maximum(current[0] + current[1], 1e-12)
        extra[name] = np.insert(values, into[order], np.concatenate([reached[late], reached[early]])[order])
    return replace(found, time=time, extra=extra, inserted=inserted)
