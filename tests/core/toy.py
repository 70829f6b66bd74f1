"""An analytic cell: an offset and a resistance are its base parameters, other terms are effects. No PyBaMM."""

from __future__ import annotations

import numpy as np
from bsa.core.contracts.requests import MeasuredRecord, Prediction
from bsa.core.effect import Effect, EffectParameter, Evidence
from bsa.core.inference.observations import observe
from bsa.core.inference.problem import Problem
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.target import InitialSoc
from bsa.core.trajectory import Step, StepKind, Trajectory

EVIDENCE = Evidence("toy", {}, 1, 0.0, 1.0)


def effect(name: str, lower: float = 0.0, upper: float = 1.0, probe: float = 0.01, **more) -> Effect:
    return Effect(name, name, name, (EffectParameter("size", "V", 0.0, lower, upper, probe),), "a mark", "none", **more)


QUADRATIC = effect("quadratic")
HYSTERESIS = effect("sign")
SLOW = effect("slow")
IMITATED = effect("second-resistance")
FADE = effect("fade", upper=0.1, probe=1e-3)


def marks(current, time):
    slow = np.zeros_like(current)
    for k in range(1, len(current)):
        keep = np.exp(-(time[k] - time[k - 1]) / 200.0)
        slow[k] = slow[k - 1] * keep + current[k - 1] * (1 - keep)
    throughput = np.concatenate([[0.0], np.cumsum(np.abs(current[1:]) * np.diff(time))]) / 3600.0
    return {
        "fade": -current * throughput,
        "quadratic": -current * np.abs(current),
        "sign": -np.sign(current),
        "slow": -slow,
        "second-resistance": -current,
        "outside": np.sin(time / 37.0) * (np.abs(current) > 0.5),
    }


class ToySimulator:
    """V = 3.8 - 0.2 q + offset - R I + the effects' marks."""

    at_once = 1
    simulations = recalled = 0
    has_low_fidelity = False

    def predict(self, requests):
        return [self.one(request) for request in requests]

    def felt(self, size):
        """By how much of its mark an effect moves the voltage, V."""
        return size

    def one(self, request):
        candidate, record, times, current = (
            request.candidate,
            request.measured_record.record,
            request.moments.time,
            request.moments.current,
        )
        charge = np.interp(times, record.time, record.discharge_capacity) + request.offset * times / 3600.0
        start = 3.6 + 0.2 * (0.9 if request.soc is None else request.soc)
        voltage = start - 0.2 * charge - candidate["resistance factor"] * 0.05 * current
        full = marks(record.current, record.time)
        for added in request.effects:
            mark = np.interp(times, record.time, full[added.name])
            voltage = voltage + self.felt(added.values(candidate)["size"]) * mark
        return Prediction(request.moments.averaged(voltage))


class TwoFidelities(ToySimulator):
    """Its cheaper model has another offset, another resistance and weaker effects; each model is counted."""

    has_low_fidelity = True

    def __init__(self):
        self.asked = {False: 0, True: 0}

    def one(self, request):
        self.asked[request.low_fidelity] += 1
        found = super().one(request)
        if not request.low_fidelity:
            return found
        return Prediction(3.0 + 1.1 * (found.voltage - 3.0))


class Unfelt(ToySimulator):
    """Its effects act on the voltage only where they are strong: at 10 probes of 0.01, and next to nothing at one."""

    def felt(self, size):
        return 10.0 * size**3


CHECK = ((0, 60), (1, 600), (0, 400), (2.5, 300), (0, 400), (-1, 500), (0, 300), (1.8, 200), (0, 200))
CYCLE = ((1, 600), (0, 200), (-1, 600), (0, 200))


def measured_record(
    name: str, rng, truth: dict[str, float], resistance=1.2, noise=1e-3, program=CHECK, cycles=1
) -> MeasuredRecord:
    time, current, steps = [], [], []
    start = count = 0
    for number in range(1, cycles + 1):
        for rate, seconds in program:
            clock = start + np.arange(0.0, seconds, 4.0)
            kind = StepKind.REST if rate == 0 else StepKind.CC_DISCHARGE if rate > 0 else StepKind.CC_CHARGE
            time.append(clock)
            current.append(np.full(len(clock), float(rate)))
            steps.append(Step(kind, count, count + len(clock), number))
            count += len(clock)
            start += seconds
    time, current = np.concatenate(time), np.concatenate(current)
    record = Trajectory(time, current, np.zeros_like(time), None, tuple(steps))
    voltage = 3.6 + 0.2 * 0.9 - 0.2 * record.discharge_capacity - resistance * 0.05 * current
    for key, size in truth.items():
        voltage = voltage + size * marks(current, time)[key]
    voltage = voltage + rng.normal(0.0, noise, len(time))
    return MeasuredRecord(name, Trajectory(time, current, voltage, None, tuple(steps)))


def problem(rng, truth: dict[str, float], held: bool = True, noise=1e-3) -> tuple[Problem, ParameterSpace]:
    fitted = [measured_record("a", rng, truth, noise=noise), measured_record("b", rng, truth, noise=noise)]
    return problem_of(fitted, [measured_record("held", rng, truth, noise=noise)] if held else [])


def problem_of(fitted: list[MeasuredRecord], kept: list[MeasuredRecord]) -> tuple[Problem, ParameterSpace]:
    resistance = Parameter("resistance factor", 1.0, 0.2, 5.0, "log", deviation=0.5, prior=True)
    states = [Parameter(s.soc_name, 0.8, 0.0, 1.0, target=InitialSoc(s.name), deviation=0.02) for s in fitted]
    made = Problem(
        ToySimulator(),
        [observe(one, points=150) for one in fitted],
        [observe(one, points=150) for one in kept],
    )
    return made, ParameterSpace((resistance, *states))
