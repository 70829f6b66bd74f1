"""A third-party plugin that is about no battery: a damped driven oscillator, solved by SciPy.

A mass on a spring and a dashpot follows ``m x'' + c x' + k x = F(t)``. The force is measured and drives it; the
displacement and the velocity are observed. The record has three steps: the mass is pulled aside, let go, and
shaken with a rising frequency.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from bsa.core.domain import Domain
from bsa.core.hooks import Entry, RunContext, hookimpl
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from bsa.core.signals import Signal
from bsa.core.simulation import ExperimentRun, Outcome, SimulationFailure
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, Trajectory
from pydantic import BaseModel, Field
from scipy.integrate import odeint

MASS, STIFFNESS, DAMPING = "Mass [kg]", "Stiffness [N.m-1]", "Damping [N.s.m-1]"
HIDDEN = {MASS: 1.2, STIFFNESS: 95.0, DAMPING: 0.9}

FORCE = Signal("force", "N", role="driven")
DISPLACEMENT = Signal("displacement", "m", tolerance=2e-4, shown_unit="mm", shown_scale=1e3, oscillates=True)
VELOCITY = Signal("velocity", "m/s", tolerance=2e-3, shown_unit="mm/s", shown_scale=1e3, oscillates=True)

OSCILLATOR = Domain(
    name="damped driven oscillator",
    expert="You are an expert in mechanical vibrations. You calibrate a model of a damped driven oscillator so that "
    "its\nsimulated record matches a measured one: the size, the timing and the decay of its swings.",
    signals=(FORCE, DISPLACEMENT, VELOCITY),
    brief_s=0.5,
    rules=(
        {
            "parameter": MASS,
            "raises": ["period"],
            "lowers": ["decay_rate"],
            "why": "Inertia slows the swing; a steady pull does not feel it.",
        },
        {
            "parameter": STIFFNESS,
            "raises": [],
            "lowers": ["period", "static_displacement"],
            "why": "The displacement under a steady force is the force over the stiffness, whatever the mass.",
        },
        {
            "parameter": DAMPING,
            "raises": ["decay_rate"],
            "lowers": ["resonance_amplitude"],
            "why": "Takes energy out of every swing; shifts the period little while it is small.",
        },
    ),
    accuracy="tolerances a thousand times tighter",
    sign_note="Force and displacement point the same way.",
)

PULL_S, DECAY_S, END_S, SAMPLING_S = 2.0, 6.0, 14.0, 0.01
PULL_N, SHAKE_N, SLOWEST_HZ, FASTEST_HZ = 6.0, 2.0, 0.5, 3.0


class OscillatorOptions(BaseModel, extra="forbid"):
    """How the equation is solved."""

    tolerance: float = Field(1e-6, gt=0, le=1e-2, description="Relative tolerance of the solver during the search.")


class OscillatorTaskOptions(BaseModel, extra="forbid"):
    """The record of the task."""

    seed: int = Field(7, ge=0, description="Seed of the measurement noise.")


def force_on(time_s: np.ndarray) -> np.ndarray:
    """A pull that rises within a second and is let go, then a shaking of rising frequency, N."""
    pull = PULL_N * np.clip(time_s, 0.0, 1.0) * (time_s <= PULL_S)
    shaken_s = np.clip(time_s - DECAY_S, 0.0, None)
    chirp = SLOWEST_HZ + 0.5 * (FASTEST_HZ - SLOWEST_HZ) * shaken_s / (END_S - DECAY_S)
    return pull + SHAKE_N * np.sin(2.0 * np.pi * chirp * shaken_s)


def swing(candidate: Candidate, target: Trajectory, tolerance: float) -> Trajectory:
    """The oscillator's record from rest under the force of a record, at its samples."""
    mass, stiffness, damping = (candidate[name] for name in (MASS, STIFFNESS, DAMPING))
    time_s, force = target.time, target.values(FORCE.name)

    def rate(now: float, state: np.ndarray) -> list[float]:
        pushed = float(np.interp(now, time_s, force))
        place, speed = state.tolist()
        return [speed, (pushed - damping * speed - stiffness * place) / mass]

    # The older interface of LSODA steps in compiled code, several times as fast as that of `solve_ivp`.
    states, told = odeint(
        rate, [0.0, 0.0], time_s, tfirst=True, rtol=tolerance, atol=1e-3 * tolerance, hmax=0.1, full_output=True
    )
    if told["message"] != "Integration successful.":
        raise ArithmeticError(told["message"])
    signals = {FORCE.name: force, DISPLACEMENT.name: states[:, 0], VELOCITY.name: states[:, 1]}
    return Trajectory(time_s, steps=target.steps, signals=signals)


def record(seed: int, hidden: Candidate = HIDDEN) -> Trajectory:
    """A measured record: the swing of an oscillator with hidden values, with noise of one tolerance."""
    time_s = np.arange(0.0, END_S + SAMPLING_S / 2, SAMPLING_S)
    bounds = [0, *(int(np.searchsorted(time_s, end, side="right")) for end in (PULL_S, DECAY_S)), len(time_s)]
    kinds = ("pull", "free decay", "sweep")
    steps = tuple(Step(kind, bounds[place], bounds[place + 1], position=place) for place, kind in enumerate(kinds))
    nothing = np.zeros_like(time_s)
    signals = {FORCE.name: force_on(time_s), DISPLACEMENT.name: nothing, VELOCITY.name: nothing}
    clean = swing(hidden, Trajectory(time_s, steps=steps, signals=signals), 1e-9)
    rng = np.random.default_rng(seed)
    noisy = {
        signal.name: clean.values(signal.name) + signal.tolerance * rng.standard_normal(len(time_s))
        for signal in (DISPLACEMENT, VELOCITY)
    }
    return clean.changed(**noisy)


def oscillator_task(options: OscillatorTaskOptions | None = None) -> Task:
    """A task whose record was made with hidden values."""
    space = ParameterSpace(
        (
            Parameter(MASS, 1.0, 0.3, 4.0, "log"),
            Parameter(STIFFNESS, 85.0, 20.0, 400.0, "log"),
            Parameter(DAMPING, 1.5, 0.05, 10.0, "log"),
        )
    )
    measured = record((options or OscillatorTaskOptions()).seed)
    return Task(
        "oscillator",
        CellModel("", "linear oscillator"),
        space,
        (Experiment("test bench", measured),),
        ("The record was made with hidden values and has the noise of its sensors.",),
        domain=OSCILLATOR,
        simulator="oscillator",
    )


class Oscillator:
    """The simulator."""

    def __init__(self, options: OscillatorOptions, context: RunContext) -> None:
        self._tolerance = options.tolerance
        self._experiments = context.task.experiments

    @hookimpl
    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        """See `RunHooks.simulate`."""
        tolerance = 1e-3 * self._tolerance if exact else self._tolerance
        for place, candidate in enumerate(candidates):
            started = time.perf_counter()
            runs = tuple(self._run(candidate, experiment, tolerance) for experiment in self._experiments)
            yield place, Outcome(runs, time.perf_counter() - started)

    def _run(self, candidate: Candidate, experiment: Experiment, tolerance: float) -> ExperimentRun:
        try:
            return ExperimentRun(swing(candidate, experiment.target, tolerance))
        except ArithmeticError as error:
            return ExperimentRun(None, SimulationFailure(f"the solver gave up: {error}"))


@hookimpl
def bsa_simulators() -> Iterable[Entry]:
    """The oscillator."""
    summary = "A damped driven oscillator: mass, stiffness and damping."
    yield Entry("oscillator", Oscillator, summary, OscillatorOptions, api=1, domain=OSCILLATOR)


@hookimpl
def bsa_tasks() -> Iterable[Entry]:
    """The bench."""
    summary = "A damped driven oscillator, pulled, let go and shaken."
    yield Entry("oscillator", oscillator_task, summary, OscillatorTaskOptions, api=1)
