"""Makes records of a cell that has an effect the base model lacks.

Built from PyBaMM alone: no import from the catalogue of effects, from the simulators that search, or from the
discovery, which a test checks. A fault that they share with the hidden cell would otherwise be invisible.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pybamm

from ...core.trajectory import FloatArray, Trajectory
from .hidden_physics import OUTSIDE, HiddenEffect, multiplied
from .protocols import Step

_INVENTORY = "cyclable lithium"
"""Not a parameter of PyBaMM: the lithium of both electrodes together."""

_RADIAL = 4
_STRETCH = 4.0
"""Times as many mesh points in a particle, and how much finer they are at its surface than at its centre (a
logarithm).

What a new current does in its first seconds happens in a fraction of the outermost of even cells, half of which acts
as a resistance. Under the pulses and the drive cycle of a cell of `OKane2022` (case 7 of seed 20261130) 120 even points
are 0.6 and 0.5 mV off (rms from 480 of them; at most 4 and 3 mV), as many that are finer at the surface 0.05 and
0.04 mV.
"""


@dataclass(frozen=True)
class Hidden:
    """What is true of a cell and is not told."""

    # parameter_set, model: PyBaMM's parameter set, and the base model.
    parameter_set: str
    model: str
    effects: tuple[HiddenEffect, ...] = ()  # Effects on top of the base model.
    strengths: Mapping[str, float] = field(default_factory=dict)  # Their strengths by the catalogue's names.
    # Factors on PyBaMM's parameters, and on ``cyclable lithium``.
    shifts: Mapping[str, float] = field(default_factory=dict)
    noise_v: float = 1e-3  # Standard deviation of the voltage noise, V.
    # Whether the noise is Student's t with four degrees of freedom, scaled to that deviation.
    heavy_tailed: bool = False
    resolution_v: float = 1e-4  # Step of the voltage readings, V.
    points: int = 30  # Mesh points in every domain; in a particle `_RADIAL` times as many.
    outside: str = ""  # Name of an effect that no catalogue has; empty for none.
    outside_strength: float = 0.0  # Its strength, V.

    def strength(self, effect: HiddenEffect) -> float:
        """The strength of one of the effects."""
        return self.strengths[effect.strength]


def measure(
    hidden: Hidden, steps: Sequence[Step], soc: float, ambient_k: float, rng: np.random.Generator
) -> tuple[Trajectory, FloatArray]:
    """Run a test on a hidden cell and read the instruments.

    Tolerances of 1e-7, events located by PyBaMM's experiments, samples on the cycler's clock, noise, rounded readings.
    Gives the record as a cycler writes it down, and the same voltage without noise and rounding, V.
    """
    values = _values(hidden, ambient_k)
    capacity = float(values["Nominal cell capacity [A.h]"])
    leak = sum(hidden.strength(effect) for effect in hidden.effects if effect.leak)
    values.set_initial_state(soc, inplace=True)
    # A record runs beyond the limits where an instrument or an overpotential says so.
    values.update({"Lower voltage cut-off [V]": 0.5, "Upper voltage cut-off [V]": 6.0})
    model = _model(hidden)
    points = dict.fromkeys(("x_n", "x_s", "x_p"), hidden.points)
    points |= dict.fromkeys(("r_n", "r_p"), _RADIAL * hidden.points)
    for effect in hidden.effects:
        points |= effect.points
    simulation = pybamm.Simulation(
        model,
        parameter_values=values,
        experiment=pybamm.Experiment([tuple(_step(step, capacity, leak) for step in steps)]),
        var_pts={**model.default_var_pts, **points},
        submesh_types=_submeshes(model),
        solver=pybamm.IDAKLUSolver(rtol=1e-7, atol=1e-8),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        solution = simulation.solve(calc_esoh=False, showprogress=False)
    parts = [part for part in solution.cycles[0].steps if not isinstance(part, pybamm.EmptySolution)]

    def entries(name: str) -> FloatArray:
        return np.concatenate([np.asarray(part[name].entries, dtype=np.float64) for part in parts])

    time = np.concatenate([part.t for part in parts])
    through, voltage = entries("Current [A]"), entries("Voltage [V]")
    for effect in hidden.effects:
        if effect.voltage is not None:
            voltage = voltage + effect.voltage(time, through, hidden.strength(effect), capacity)
    current = through - leak
    for effect in hidden.effects:
        if effect.instrument is not None:
            current, voltage = effect.instrument(time, current, voltage, hidden.strength(effect))
    noisy = voltage + _noise(hidden, len(voltage), rng)
    read = np.round(noisy / hidden.resolution_v) * hidden.resolution_v
    temperature = entries("Volume-averaged cell temperature [K]") + rng.normal(0.0, 0.05, len(voltage))
    return Trajectory(np.round(time, 4), np.round(current, 4), np.round(read, 6), np.round(temperature, 2)), voltage


def _submeshes(model: Any) -> dict[str, Any]:
    """Meshes by PyBaMM's domain: those of particles are finer at the surface."""
    finer = pybamm.MeshGenerator(pybamm.Exponential1DSubMesh, {"side": "right", "stretch": _STRETCH})
    usual: dict[str, Any] = model.default_submesh_types
    return usual | {domain: finer for domain in ("negative particle", "positive particle") if domain in usual}


def _noise(hidden: Hidden, count: int, rng: np.random.Generator) -> FloatArray:
    drawn = rng.standard_t(4.0, count) / np.sqrt(2.0) if hidden.heavy_tailed else rng.normal(0.0, 1.0, count)
    return np.asarray(hidden.noise_v * drawn, dtype=np.float64)


def _values(hidden: Hidden, ambient_k: float) -> Any:
    values = pybamm.ParameterValues(hidden.parameter_set)
    values.update({"Ambient temperature [K]": ambient_k, "Initial temperature [K]": ambient_k})
    for name, factor in hidden.shifts.items():
        if name == _INVENTORY:
            for which in ("negative", "positive"):
                values[f"Initial concentration in {which} electrode [mol.m-3]"] *= factor
        elif callable(values[name]):
            values[name] = multiplied(values[name], lambda *arguments, factor=factor: factor)
        else:
            values[name] = factor * values[name]
    for effect in hidden.effects:
        if effect.prepare is not None:
            effect.prepare(values, hidden.strength(effect), ambient_k)
    return values


def _model(hidden: Hidden) -> Any:
    options: dict[str, str] = {}
    name = hidden.model
    for effect in hidden.effects:
        options |= effect.options
        name = effect.model or name
    model = getattr(pybamm.lithium_ion, name)(options)
    if hidden.outside:
        extra, _, _ = OUTSIDE[hidden.outside]
        model.variables["Voltage [V]"] = model.variables["Voltage [V]"] + extra(model, hidden.outside_strength)
    return model


def _step(step: Step, capacity: float, leak: float) -> Any:
    ends = [f"{step.until_v} V"] * (step.until_v is not None)
    if step.until_rate is not None:
        ends.append(f"{step.until_rate * capacity} A")
    if step.hold_v is not None:
        return pybamm.step.voltage(step.hold_v, duration=step.seconds, termination=ends, period=step.period)
    if isinstance(step.rate, (int, float)):
        current = step.rate * capacity + leak
        return pybamm.step.current(current, duration=step.seconds, termination=ends or None, period=step.period)
    assert step.rate is not None
    profile = np.asarray(step.rate, dtype=np.float64) * capacity + leak
    clock = np.arange(len(profile), dtype=np.float64)
    # Of a current that changes sign PyBaMM cannot tell from which side the voltage comes.
    below = [f"< {end}" for end in ends]
    return pybamm.step.current(
        np.column_stack([clock, profile]), duration=clock[-1], period=step.period, termination=below or None
    )
