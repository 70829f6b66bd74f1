"""Where the model is wrong: the residual by segment, rate, state of charge, time since the last step, and cycle."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.constants import zero_Celsius

from ..comparison.overlap import weighted_rms
from ..inference.observations import Observations
from ..trajectory import SECONDS_PER_HOUR, FloatArray, StepKind

_SINCE_EDGES_S = (2.0, 30.0, 300.0, 1200.0)
_SINCE_NAMES = ("0-2 s", "2-30 s", "30 s-5 min", "5-20 min", "over 20 min")

LAYOUTS = {
    "segment": "segment",
    "rate": "rate",
    "charge": "charge drawn",
    "since step": "time since the last step",
    "temperature": "temperature",
    "cycle": "cycle",
}
"""What the residual map is laid out by, in words."""


@dataclass(frozen=True)
class Place:
    """One cell of the residual map."""

    by: str  # What the map is laid out by.
    where: str
    # rms_mv, bias_mv: Root mean square and mean of simulated minus measured voltage, mV.
    rms_mv: float
    bias_mv: float
    z: float  # The bias over its standard error.
    share: float  # Share of the squared misfit (squared error beyond noise) that lies here, 0 to 1.
    trend_mv_per_h: float  # Slope of that difference with time within the place, mV per hour.
    samples: int  # Averages that it rests on.


def localise(observations: Sequence[Observations], errors: Sequence[FloatArray], capacity_ah: float) -> list[Place]:
    """Lay the residual out; ``errors`` are measured minus simulated voltage by record, V.

    A bias is simulated minus measured, as on the page of a calibration.
    The capacity makes C-rates of currents and shares of charges.
    """
    difference = -np.concatenate(list(errors))
    sigma, count, since, cycle = (
        np.concatenate([getattr(observed, name) for observed in observations])
        for name in ("sigma", "count", "since", "cycle")
    )
    excess = np.maximum(difference**2 - sigma**2, 0.0) * count
    rows, whole = np.array([difference, sigma, count, since, excess]), float(np.sum(excess))
    places: list[Place] = []
    for by, names_of in _NAMES.items():
        if by == "cycle" and np.ptp(cycle) == 0:
            continue
        if by == "temperature" and all(
            o.temperature is None and o.measured_record.ambient_k is None for o in observations
        ):
            continue
        names = np.concatenate([names_of(observed, capacity_ah) for observed in observations])
        places += [_place(by, name, rows[:, names == name], whole) for name in dict.fromkeys(names.tolist())]
    return places


def _place(by: str, where: str, rows: FloatArray, whole: float) -> Place:
    difference, sigma, count, since, excess = rows
    weight = 1 / sigma**2
    bias = float(np.sum(weight * difference) / np.sum(weight))
    centred = since - np.mean(since)
    spread = len(since) > 3 and np.ptp(since) > 60
    slope = float(np.sum(centred * difference) / np.sum(centred**2)) if spread else 0.0
    return Place(
        by,
        where,
        1e3 * weighted_rms(count, difference),
        1e3 * bias,
        bias * float(np.sqrt(np.sum(weight))),
        float(np.sum(excess)) / whole if whole > 0 else 0.0,
        1e3 * SECONDS_PER_HOUR * slope,
        len(difference),
    )


def _segment(observed: Observations, capacity: float) -> NDArray[np.str_]:
    names = []
    for number, kind in enumerate(step.kind for step in observed.measured_record.record.steps):
        here = observed.step == number
        rate = abs(_mean_current(observed, here)) / capacity
        after = " after current" if kind is StepKind.REST and number > 0 else ""
        names.append(f"{observed.name}: {kind}{after}" + (f" at {rate:.2g}C" if kind is not StepKind.REST else ""))
    return np.array(names)[observed.step]


def _mean_current(observed: Observations, here: NDArray[np.bool_]) -> float:
    """Mean over the time of some averages in a row, A: samples are closer together where the current falls."""
    if not np.any(here):
        return 0.0
    time, charge = observed.time[here], observed.charge[here]
    took_h = float(time[-1] - time[0]) / SECONDS_PER_HOUR
    return float(charge[-1] - charge[0]) / took_h if took_h > 0.0 else float(np.mean(observed.current[here]))


def _rate(observed: Observations, capacity: float) -> NDArray[np.str_]:
    rate = observed.current / capacity
    names = np.full(len(rate), "rest", dtype=object)
    for low, high in ((0.02, 0.3), (0.3, 0.8), (0.8, 1.5), (1.5, np.inf)):
        label = f"{low:g}-{high:g}C" if high < np.inf else f"over {low:g}C"
        names[(rate > low) & (rate <= high)] = f"discharge {label}"
        names[(rate < -low) & (rate >= -high)] = f"charge {label}"
    return names.astype(str)


def _charge(observed: Observations, capacity: float) -> NDArray[np.str_]:
    drawn = observed.charge - np.min(observed.charge)
    part = np.clip((5 * drawn / max(capacity, 1e-9)).astype(int), 0, 4)
    names = np.array([f"{20 * k}-{20 * (k + 1)} % of the capacity drawn" for k in range(5)])
    return np.asarray(names[part], dtype=np.str_)


def _since(observed: Observations, capacity: float) -> NDArray[np.str_]:
    place = np.searchsorted(_SINCE_EDGES_S, observed.since, side="right")
    resting = np.abs(observed.current) < 0.02 * capacity
    return np.array(
        [f"{'at rest' if r else 'under current'}, {_SINCE_NAMES[k]}" for k, r in zip(place, resting, strict=True)]
    )


def _temperature(observed: Observations, capacity: float) -> NDArray[np.str_]:
    kelvin, ambient_k = observed.temperature, observed.measured_record.ambient_k
    if kelvin is None and ambient_k is None:
        return np.full(len(observed), "not known")
    celsius = (np.full(len(observed), ambient_k) if kelvin is None else kelvin) - zero_Celsius
    low = 10 * np.floor(celsius / 10)
    return np.array([f"{value:.0f} to {value + 10:.0f} degC" for value in low])


def _cycle(observed: Observations, capacity: float) -> NDArray[np.str_]:
    return np.array([f"cycle {number}" for number in observed.cycle])


_NAMES: dict[str, Callable[[Observations, float], NDArray[np.str_]]] = {
    "segment": _segment,
    "rate": _rate,
    "charge": _charge,
    "since step": _since,
    "temperature": _temperature,
    "cycle": _cycle,
}
"""For each layout (`LAYOUTS`) the place of each stretch, from a record's averages and the capacity, A.h."""


def in_words(places: Sequence[Place], noise_v: float) -> list[str]:
    """The map in a few sentences: the largest discrepancies first, then where the model is right."""
    noise = 1e3 * noise_v
    segments = sorted((p for p in places if p.by == "segment"), key=lambda p: -p.share)
    sentences = []
    for place in segments[:4]:
        if place.share < 0.05:
            continue
        direction = "below" if place.bias_mv > 0 else "above"
        growing = ""
        if abs(place.trend_mv_per_h) > 2 * max(noise, 1.0):
            same = place.trend_mv_per_h * place.bias_mv > 0
            growing = ", growing with time" if same else ", shrinking with time"
        sentences.append(
            f"The measured voltage lies on average {abs(place.bias_mv):.1f} mV {direction} the model during "
            f"{place.where}{growing} (rms {place.rms_mv:.1f} mV, {place.share:.0%} of the squared misfit)"
        )
    for by in ("rate", "since step", "cycle"):
        rows = [p for p in places if p.by == by and p.samples >= 4]
        if len(rows) > 1:
            worst = max(rows, key=lambda p: p.rms_mv)
            best = min(rows, key=lambda p: p.rms_mv)
            sentences.append(
                f"By {LAYOUTS[by]}, the largest error: {worst.where} ({worst.rms_mv:.1f} mV rms, simulated minus "
                f"measured on average {worst.bias_mv:+.1f} mV); the smallest: {best.where} ({best.rms_mv:.1f} mV rms)"
            )
    return sentences
