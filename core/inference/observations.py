"""A record condensed to what a fit needs: a few hundred averages, each with its uncertainty."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..comparison.knees import CHARGE_SHARE, CLOCK_SHARE, USUAL_SLOPE
from ..comparison.noise import noise_freedom, noise_of, resolution, rounding_that_stays
from ..contracts.requests import MeasuredRecord, Moments
from ..trajectory import FloatArray, StepKind, Trajectory

FLOOR_V = 3e-4
"""Voltage differences below this are not physics: discretisation, interpolation of the current, the converter."""

AFTER_JUMP_S = 2e-3
"""Where a step's first sample carries the stamp of the last one before it, it was taken this much later."""

_UNKNOWN_NOISE_V = 1e-3
"""Noise of a record that is too short to tell it, V: that of a usual cycler."""

_MOMENTS = 8
"""Moments at most at which a simulation is looked at for one average."""

_SINGLE = 5
"""Samples after a current step that stand alone: what happens there happens fast."""

_PARTS = 12
"""Parts of the charge of a varying current between which the slope of its voltage is taken: some minutes each, over
which a drive cycle's currents average out, and as many as the averages of the shortest step."""


@dataclass(frozen=True, eq=False)
class Observations:
    """Averages over short stretches of one record; shapes are (n,)."""

    measured_record: MeasuredRecord  # What they are averages of.
    # time, current, voltage: Mean time (s), current (A, positive on discharge) and voltage (V) of each stretch.
    time: FloatArray
    current: FloatArray
    voltage: FloatArray
    # Standard deviation of ``voltage``: noise of the mean, rounding, the floor, and the uncertainty of the clock, V.
    sigma: FloatArray
    count: FloatArray  # Samples in each stretch.
    step: NDArray[np.intp]  # Index of the step each stretch lies in.
    cycle: NDArray[np.intp]  # Cycle of each stretch.
    since: FloatArray  # Seconds since the current last stepped.
    charge: FloatArray  # Charge drawn since the start of the record, A.h.
    temperature: FloatArray | None  # Measured temperature, K.
    noise: float  # Standard deviation of one sample, V.
    noise_freedom: float  # Degrees of freedom from which that is estimated; infinite where it is assumed.
    floor: float  # Differences below this are not physics, V.
    moments: Moments  # When a simulation is looked at to be compared.
    # Errors of ``voltage`` that do not average out, V, each a column, shape (n, k); ``sigma`` holds their size.
    systematic: FloatArray

    def __len__(self) -> int:
        return len(self.time)

    @property
    def name(self) -> str:
        """The record's name."""
        return self.measured_record.name


def observe(measured_record: MeasuredRecord, points: int = 500, floor_v: float = FLOOR_V) -> Observations:
    """Condense a record to about so many stretches of its steps; voltages closer than ``floor_v`` count as equal."""
    record = measured_record.record
    noise = voltage_noise(record)
    shared = rounding_that_stays(noise, resolution(record.voltage))
    groups: list[NDArray[np.intp]] = []
    steps: list[int] = []
    per_step = max(12, points // max(len(record.steps), 1))
    drives = sum(step.kind is StepKind.DRIVE for step in record.steps)
    for number, step in enumerate(record.steps):
        taken = step.start + np.flatnonzero(~record.inserted[step.start : step.stop])
        if step.kind is StepKind.DRIVE:
            stride = max(1, int(np.ceil(len(taken) / (points / max(drives, 1)))))
            pieces = [taken[k : k + 1] for k in range(0, len(taken), stride)]
        else:
            pieces = [taken[piece] for piece in _stretches(record.time[taken], per_step)]
        groups += pieces
        steps += [number] * len(pieces)
    index = np.array(steps, dtype=np.intp)

    def mean(values: FloatArray) -> FloatArray:
        return np.array([float(np.mean(values[group])) for group in groups])

    count = np.array([float(len(group)) for group in groups])
    # A step begins where the one before it logged its last sample: its own first sample may come much later.
    starts = np.array([record.time[max(step.start - 1, 0)] for step in record.steps])
    jitter = CLOCK_SHARE * _neighbour_change(record.voltage)
    # Errors of the clock within a stretch do not average out the way noise does, but a stretch is mostly flat.
    clock = np.sqrt(mean(jitter**2) / count)
    charge = np.interp(mean(record.time), record.time, record.discharge_capacity)
    voltage = mean(record.voltage)
    driven = np.array([step.kind is StepKind.DRIVE for step in record.steps])[index]
    knee = CHARGE_SHARE * _steepness(charge, voltage, index, driven) * max(float(np.ptp(charge)), 1e-9)
    clocked = after_jumps(record)
    time = np.minimum(mean(clocked), record.time[-1])
    return Observations(
        measured_record,
        time,
        mean(record.current),
        voltage,
        np.sqrt((noise**2 - shared**2) / count + shared**2 + floor_v**2 + clock**2 + knee**2),
        count,
        index,
        np.array([record.steps[number].cycle for number in steps], dtype=np.intp),
        time - starts[index],
        charge,
        None if record.temperature is None else mean(record.temperature),
        noise,
        noise_freedom(record),
        floor_v,
        _moments(record, clocked, groups),
        np.zeros((len(groups), 0)),
    )


def voltage_noise(record: Trajectory) -> float:
    """Standard deviation of the voltage's measurement noise, V; 1 mV where the record is too short to tell it."""
    return noise_of(record, record.voltage) or max(_UNKNOWN_NOISE_V, resolution(record.voltage))


def freedom_of_deviations(observations: Sequence[Observations], sigmas: Sequence[FloatArray]) -> float:
    """Degrees of freedom of the deviations of some records together; infinite where none hangs on an estimate.

    Noise is a part of each deviation, and what else is in them counts as known (Satterthwaite, Biometrics Bull. 2
    (1946) 110). ``sigmas`` are the deviations of the stretches of each record, V.
    """
    total = sum(map(len, sigmas))
    doubt = sum(
        (float(np.sum(observed.noise**2 / (observed.count * sigma**2))) / total) ** 2 / observed.noise_freedom
        for observed, sigma in zip(observations, sigmas, strict=True)
    )
    return 1.0 / doubt if doubt > 0.0 else np.inf


def _moments(record: Trajectory, taken: FloatArray, groups: Sequence[NDArray[np.intp]]) -> Moments:
    """Every sample of a short stretch; of a long one, the means of a few parts."""
    parts = [np.array_split(group, min(len(group), _MOMENTS)) for group in groups]
    flat = [part for stretch in parts for part in stretch]
    return Moments(
        np.minimum([float(np.mean(taken[part])) for part in flat], record.time[-1]),
        np.array([float(np.mean(record.current[part])) for part in flat]),
        np.array([len(part) / len(group) for group, stretch in zip(groups, parts, strict=True) for part in stretch]),
        np.repeat(np.arange(len(groups)), [len(stretch) for stretch in parts]),
    )


def _steepness(
    charge: FloatArray, voltage: FloatArray, steps: NDArray[np.intp], driven: NDArray[np.bool_]
) -> FloatArray:
    """Slope of voltage with charge (V/A.h) beyond three times what is usual in the record; 0 elsewhere and at rest.

    At the end of a discharge a cell loses a volt within a percent of its charge: there the vertical distance of
    two curves measures an error of capacity, many times over. Of a varying current, whose ``driven`` samples differ by
    their currents much more than by their charge, the slope is that of the means of longer parts.
    """
    slope = np.zeros_like(charge)
    usual: list[float] = []
    for number in np.unique(steps):
        here = np.flatnonzero(steps == number)
        if len(here) < 8 or np.ptp(charge[here]) < 0.02 * max(np.ptp(charge), 1e-9):
            continue
        # The first samples of a step fall for another reason.
        here = here[6:]
        if np.ptp(charge[here]) == 0.0:
            continue
        slope_of = _slope_of_parts if driven[here[0]] else _slope_of_samples
        slope[here] = slope_of(charge[here], voltage[here])
        usual += list(slope[here])
    return np.maximum(slope - USUAL_SLOPE * float(np.median(usual)), 0.0) if usual else slope


def _slope_of_samples(charge: FloatArray, voltage: FloatArray) -> FloatArray:
    """Size of the slope of voltage with charge at each sample, from its neighbours."""
    # A cycler logs the end of a step once more where a sample is due.
    drawn, first, copies = np.unique(charge, return_index=True, return_inverse=True)
    return np.asarray(np.abs(np.gradient(voltage[first], drawn))[copies])


def _slope_of_parts(charge: FloatArray, voltage: FloatArray) -> FloatArray:
    """Size of the slope of voltage with charge at each sample, between the means of equal parts of the charge drawn."""
    edges = np.linspace(np.min(charge), np.max(charge), _PARTS + 1)[1:-1]
    place = np.unique(np.searchsorted(edges, charge), return_inverse=True)[1]
    samples = np.bincount(place)
    drawn, mean = (np.bincount(place, values) / samples for values in (charge, voltage))
    return np.asarray(np.abs(np.gradient(mean, drawn))[place])


def after_jumps(record: Trajectory) -> FloatArray:
    """The samples' times, with each step's samples after the jump that begins it."""
    time = record.time.copy()
    for step in record.steps[1:]:
        own = slice(step.start, step.stop)
        time[own] = np.maximum(time[own], record.time[step.start - 1] + AFTER_JUMP_S)
    return time


def _stretches(time: FloatArray, wanted: int) -> list[NDArray[np.intp]]:
    """Groups of neighbouring samples: single ones at first, then longer ones, evenly spaced in sqrt(time)."""
    size = len(time)
    if size <= wanted:
        return [np.array([k]) for k in range(size)]
    elapsed = time - time[0]
    edges = np.linspace(0.0, np.sqrt(elapsed[-1]), wanted - _SINGLE + 1) ** 2
    place = np.searchsorted(edges, elapsed, side="right")
    place[:_SINGLE] = -np.arange(_SINGLE, 0, -1)
    cuts = np.flatnonzero(np.diff(place)) + 1
    return list(np.split(np.arange(size, dtype=np.intp), cuts))


def _neighbour_change(voltage: FloatArray) -> FloatArray:
    change = np.abs(np.diff(voltage))
    padded = np.concatenate([[0.0], change, [0.0]])
    return np.asarray(np.maximum(padded[:-1], padded[1:]), dtype=np.float64)


def subset(observed: Observations, mask: NDArray[np.bool_]) -> Observations:
    """The stretches that a mask of shape (n,) picks."""
    moments = observed.moments
    kept = mask[moments.stretch]
    by_stretch: dict[str, Any] = {k: v[mask] for k, v in vars(observed).items() if isinstance(v, np.ndarray)}
    return replace(
        observed,
        **by_stretch,
        moments=Moments(
            moments.time[kept],
            moments.current[kept],
            moments.share[kept],
            (np.cumsum(mask) - 1)[moments.stretch[kept]],
        ),
    )
