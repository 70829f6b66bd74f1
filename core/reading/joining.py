"""Several files of one cell as one record: their order, their clocks and their counts of cycles."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..printable import counted, listed, were
from ..trajectory import FloatArray
from .clock import RESTART_S, begins_anew, usual_interval
from .date_order import date_at, starts_of, with_one_order
from .samples import Extra, Mask, Samples

_LISTED = 5


def joined(parts: Sequence[Samples], source: str) -> Samples:
    """Put the samples of one cell's files (or sheets, or tests) one after the other.

    They are ordered by the date of their first samples or by the date in their names, and stay in the order given where
    some have neither. Files that alternate in time (the pulses in one, the discharges between them in the other) are
    merged by date. Clocks and numbers of cycles are carried on. Raises `BsaError` if the dates do not tell the month
    from the day, and the order hangs on it.
    """
    if len(parts) == 1:
        return parts[0]
    parts = [carried_on(part) for part in with_one_order(parts)]
    starts = starts_of(parts)
    dated = not np.isnan(starts).any()
    order = np.argsort(starts, kind="stable") if dated else np.arange(len(parts))
    parts, starts = [parts[k] for k in order], starts[order]
    how = (
        "by date" + ", those of one day in the order given" * (len(set(starts)) < len(parts))
        if dated
        else "in the order given, for want of dates"
    )
    whole = _concatenated(parts, source).noted(
        f"{len(parts)} parts were joined {how}: {listed((part.source for part in parts), _LISTED)}."
    )
    overlap = any(date_at(one, -1) > date_at(two, 0) for one, two in pairwise(parts))
    if overlap and all("date" in part.extra for part in parts):
        return _merged(whole)
    bounds = np.cumsum([len(part) for part in parts])[:-1]
    return _on(whole, bounds, everything=True)


def carried_on(samples: Samples, everything: bool = False) -> Samples:
    """Let a clock that restarts run on, where dates or a count of cycles show that the record goes on.

    ``everything`` carries on all restarts, whatever shows it.
    """
    return _on(samples, np.zeros(0, dtype=np.intp), everything)


def _on(samples: Samples, bounds: NDArray[np.intp], everything: bool) -> Samples:
    """Carry the clock on at the given samples, and where it falls."""
    places, passed = _restarts(samples, bounds, everything)
    if len(places) == 0:
        return samples
    time, known = samples.time, np.isfinite(passed)
    written = time[places] - time[places - 1]
    falls = written < 0.0
    # A clock that goes on as dates do, which may be written to the minute, is finer than these.
    goes_on = ~falls & ~(np.abs(written - passed) > _rounding_s(samples))
    gaps = np.where(goes_on, written, np.where(known, passed, usual_interval(time) or 1.0))
    shift = np.zeros(len(samples))
    shift[places] = gaps - written
    extra = dict(samples.extra)
    if falls.any():
        extra["test"] = _tests_counted(samples.extra.get("test"), places[falls], len(samples))
    if "cycle" in extra:
        extra["cycle"] = _counted_on(extra["cycle"], _where_cycles_begin_anew(samples, places, bounds))
    result = replace(samples, time=time + np.cumsum(np.nan_to_num(shift)), extra=extra)
    return replace(result, notes=(*result.notes, *_notes_on(samples, places[falls], gaps[falls], known[falls])))


def _restarts(samples: Samples, bounds: NDArray[np.intp], everything: bool) -> tuple[NDArray[np.intp], FloatArray]:
    """Places where the clock is to be carried on, and the seconds that passed there by dates (NaN where unknown).

    Unless ``everything`` is carried on, dates or a count of cycles must show that the record goes on there.
    """
    time, cycle = samples.time, samples.extra.get("cycle")
    with np.errstate(invalid="ignore", over="ignore"):  # what is no time is refused later, with its row
        fallen = np.flatnonzero((np.diff(time) < -RESTART_S) | begins_anew(time) | _begins_step(samples)) + 1
    fallen = fallen[time[fallen] < time[np.maximum(fallen - 2, 0)]]  # else the sample before was a lone spike
    places = np.union1d(bounds, fallen).astype(np.intp)
    passed = _passed(samples, places)
    if everything:
        return places, passed
    goes_on = np.isfinite(passed)
    if cycle is not None:
        goes_on |= cycle[places] == cycle[places - 1] + 1
    return places[goes_on], passed[goes_on]


def _where_cycles_begin_anew(samples: Samples, places: NDArray[np.intp], bounds: NDArray[np.intp]) -> NDArray[np.intp]:
    """At which of the places a number of a cycle that does not rise is that of another count."""
    if len(bounds):
        return np.intersect1d(places, bounds)
    time, cycle, before = samples.time, samples.extra["cycle"], places - 1
    # A clock of each step, not of the test: it falls by little somewhere, or a later step of the same cycle begins.
    short = time[places] >= time[before] - RESTART_S
    same = (cycle[places] == cycle[before]) & _goes_on_with_steps(samples, places)
    by_step = bool(np.any(short | same))
    return places[cycle[places] < cycle[before]] if by_step else places


def _goes_on_with_steps(samples: Samples, places: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Where the number of the step rises; without such numbers, where dates show no pause."""
    step = samples.extra.get("step")
    if step is not None:
        return np.asarray(step[places] > step[places - 1])
    return np.asarray(_passed(samples, places) <= usual_interval(samples.time))


def _notes_on(samples: Samples, places: NDArray[np.intp], gaps: FloatArray, known: NDArray[np.bool_]) -> Iterator[str]:
    """What is to be said of clocks that fall and were carried on; ``known`` are those with dates."""
    told = zip(places[:_LISTED].tolist(), gaps.tolist(), known.tolist(), strict=False)
    for place, gap, dated in told:
        when = f"{gap:g} s later by its date" if dated else "after one interval, for want of a date"
        yield f"the clock restarts in {samples.place(place)}; it was carried on {when}."
    if (more := len(places) - _LISTED) > 0:
        yield f"{counted(more, 'more restart')} of the clock {were(more)} carried on in the same way."


def _begins_step(samples: Samples) -> Mask:
    """Where a clock falls by less than `RESTART_S`, and dates show that it restarted. Shape (n - 1,).

    That is a clock of the time in each step, some of which are short. The dates go forward where it falls, and from the
    next sample on the clock goes on as they do; after a row that is out of order it returns to where it was.
    """
    date, time = samples.extra.get("date"), samples.time
    if date is None:
        return np.zeros(max(len(time) - 1, 0), dtype=np.bool_)
    passed, ticked, rounded = np.diff(date), np.diff(time), _rounding_s(samples)
    goes_on = np.append(np.abs(ticked - passed)[1:] <= rounded, False)
    return np.asarray((passed >= 0.0) & (ticked < -rounded) & goes_on)


def _rounding_s(samples: Samples) -> float:
    """By how much what passes between two dates may be off, s; infinite without dates."""
    passed = np.diff(samples.extra.get("date", np.zeros(0)))
    return 2.0 * float(np.min(passed[passed > 0.0], initial=np.inf))


def _passed(samples: Samples, places: NDArray[np.intp]) -> FloatArray:
    """Seconds between the samples and those before them by their dates; NaN where unknown or negative."""
    date = samples.extra.get("date")
    if date is None:
        return np.full(len(places), np.nan)
    passed = date[places] - date[places - 1]
    return np.where(passed >= 0, passed, np.nan)


def _counted_on(cycle: FloatArray, places: NDArray[np.intp]) -> FloatArray:
    """The numbers of cycles, going on where they start again at one of the places."""
    before, after = cycle[places - 1], cycle[places]
    again = ~(after > before)
    shift = np.zeros(len(cycle))
    shift[places[again]] = before[again] + 1 - after[again]
    return cycle + np.cumsum(np.nan_to_num(shift))


def _tests_counted(test: FloatArray | None, places: NDArray[np.intp], count: int) -> FloatArray:
    """The number of each sample's test, with a new one at each of the places: a clock restarts with a test."""
    begins = np.zeros(count, dtype=np.bool_)
    if test is not None:
        begins[1:] = np.diff(test) != 0
    begins[places] = True
    return np.cumsum(begins).astype(np.float64)


def _concatenated(parts: Sequence[Samples], source: str) -> Samples:
    lengths = [len(part) for part in parts]
    names: dict[Extra, None] = {name: None for part in parts for name in part.extra}
    measured = [np.full(len(part), np.nan) if part.temperature is None else part.temperature for part in parts]
    no_temperature = all(part.temperature is None for part in parts)
    return Samples(
        source=source,
        time=np.concatenate([part.time for part in parts]),
        voltage=np.concatenate([part.voltage for part in parts]),
        current=np.concatenate([part.current for part in parts]),
        temperature=None if no_temperature else np.concatenate(measured),
        rows=np.concatenate([part.rows for part in parts]),
        names={signal: name for part in reversed(parts) for signal, name in part.names.items()},
        without_unit=parts[0].without_unit,
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        ambient_k=next((part.ambient_k for part in parts if part.ambient_k is not None), None),
        day_first=next((part.day_first for part in parts if part.day_first is not None), None),
        sheets=tuple(part.source for part in parts),
        sheet=np.repeat(np.arange(len(parts)), lengths).astype(np.int64),
        extra={
            name: np.concatenate([part.extra.get(name, np.full(len(part), np.nan)) for part in parts]) for name in names
        },
    )


def _merged(samples: Samples) -> Samples:
    """The samples by date; within a part its own, finer clock counts from its first date."""
    assert samples.sheet is not None
    time = samples.time.copy()
    for part in np.unique(samples.sheet):
        inside = np.flatnonzero(samples.sheet == part)
        dated = inside[np.isfinite(samples.extra["date"][inside])][0]
        time[inside] += samples.extra["date"][dated] - time[dated]
    time -= time.min()
    order = np.argsort(time, kind="stable")
    # Numbers of steps, cycles and tests are each part's own; a cycler's counters of charge run on through its files.
    kept = {name: values[order] for name, values in samples.extra.items() if name not in ("step", "cycle", "test")}
    merged = replace(samples.kept(order), time=time[order], extra=kept)
    return merged.noted("the parts alternate in time; their samples were merged by date, to the second.")
