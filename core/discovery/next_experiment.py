"""The experiment that would tell two explanations apart."""

from dataclasses import dataclass

import numpy as np

from ..contracts.requests import MeasuredRecord, Moments, Request, Simulator
from ..rms import rms
from ..trajectory import Step, StepKind, Trajectory
from .explanation import Explanation

Phase = tuple[float, float]
"""C-rate (positive on discharge) and seconds."""


_SAMPLES = 40
"""Samples of a phase."""


@dataclass(frozen=True)
class Protocol:
    """A test that a cycler can run."""

    title: str
    soc: float  # State of charge at which it starts.
    phases: tuple[Phase, ...]

    @property
    def steps(self) -> tuple[str, ...]:
        """The phases as PyBaMM step strings."""
        words = []
        for rate, seconds in self.phases:
            duration = f"{seconds:.3g} seconds" if seconds < 120 else f"{seconds / 60:.3g} minutes"
            action = "Rest" if rate == 0 else f"Discharge at {rate:g}C" if rate > 0 else f"Charge at {-rate:g}C"
            words.append(f"{action} for {duration}")
        return tuple(words)


@dataclass(frozen=True)
class NextExperiment:
    """A protocol with what two explanations say about it."""

    title: str
    steps: tuple[str, ...]  # As PyBaMM step strings.
    start_soc: float  # State of charge at which it starts, 0 to 1.
    # rms_mv, largest_mv: Root mean square and largest difference between the two predictions, mV.
    rms_mv: float
    largest_mv: float
    separates: tuple[str, str]
    enough: bool  # Whether the difference stands clear of the noise.


PROTOCOLS = (
    Protocol(
        "slow discharge and charge over the whole range", 0.95, ((0.1, 30000), (0, 3600), (-0.1, 28000), (0, 3600))
    ),
    Protocol("long rest after a partial discharge", 0.9, ((0.5, 2400), (0, 86400))),
    Protocol("discharge at high rate, then relaxation", 0.95, ((2.0, 1000), (0, 5400))),
    Protocol(
        "very high rate for a minute at two depths", 0.9, ((3, 60), (0, 1800), (1, 900), (0, 1800), (3, 60), (0, 900))
    ),
    Protocol(
        "short pulses of four rates",
        0.6,
        ((0.5, 10), (0, 300), (1, 10), (0, 300), (2, 10), (0, 300), (4, 10), (0, 300)),
    ),
    Protocol(
        "charge pulses after discharge pulses",
        0.5,
        ((1, 30), (0, 600), (-1, 30), (0, 600), (2, 30), (0, 600), (-2, 30)),
    ),
    Protocol("symmetric half-range cycles at C/5", 0.7, ((0.2, 7200), (0, 1800), (-0.2, 7200), (0, 1800))),
    Protocol("pulses near the empty cell", 0.2, ((1, 30), (0, 900), (2, 20), (0, 900))),
    Protocol("alternating current of one minute", 0.5, (*(((1.5, 60), (-1.5, 60)) * 10), (0, 1800))),
)
"""What is tried."""


def propose(
    simulator: Simulator,
    first: Explanation,
    second: Explanation,
    capacity_ah: float,
    noise_v: float,
    ambient_k: float | None = None,
) -> NextExperiment | None:
    """The protocol on which two fitted explanations differ most; None if none could be simulated.

    Where the difference stands clear of the noise on some, it is one of these. The mean difference over each protocol
    is taken off first: an unknown initial state of charge would take it.
    """
    best: NextExperiment | None = None
    for protocol in PROTOCOLS:
        measured_record = _record(protocol, capacity_ah, ambient_k)
        moments = Moments.single(measured_record.record.time, measured_record.record.current)
        found = simulator.predict(
            [Request(e.effects, e.fit.candidate, measured_record, moments, soc=protocol.soc) for e in (first, second)]
        )
        voltages = [prediction.voltage for prediction in found if prediction is not None]
        if len(voltages) < 2:
            continue
        difference = voltages[0] - voltages[1]
        difference = difference - np.mean(difference)
        rms_mv = 1e3 * rms(difference)
        largest = float(np.max(np.abs(difference)))
        enough = largest > max(3 * noise_v, 1e-3)
        if best is None or (enough, rms_mv) > (best.enough, best.rms_mv):
            names = (first.label, second.label)
            found_mv = (rms_mv, 1e3 * largest)
            best = NextExperiment(protocol.title, protocol.steps, protocol.soc, *found_mv, names, enough)
    return best


def _record(protocol: Protocol, capacity_ah: float, ambient_k: float | None) -> MeasuredRecord:
    rates, seconds = zip(*protocol.phases, strict=True)
    starts = np.cumsum([0.0, *seconds])[:-1]
    clocks = [
        start + 0.01 + np.linspace(0.0, np.sqrt(lasts - 0.02), _SAMPLES) ** 2
        for start, lasts in zip(starts, seconds, strict=True)
    ]
    kinds = {0: StepKind.REST, 1: StepKind.CC_DISCHARGE, -1: StepKind.CC_CHARGE}
    steps = [Step(kinds[int(np.sign(rate))], k * _SAMPLES, (k + 1) * _SAMPLES) for k, rate in enumerate(rates)]
    time, current = np.concatenate(clocks), np.repeat(capacity_ah * np.array(rates), _SAMPLES)
    return MeasuredRecord(
        protocol.title, Trajectory(time, current, np.full(len(time), 3.7), None, tuple(steps)), ambient_k
    )
