"""Makes records of a cell that has an effect the base model lacks. Shares no solver code with the discovery."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...core.effect import Effect
from ...core.target import change_of, targets_named
from ...core.task import CellModel
from ...core.trajectory import FloatArray, Trajectory
from ...plugins.pybamm.augmentation import augmented_cell, part_of
from ...plugins.pybamm.compiled import make_model
from ...plugins.pybamm.driven_cell import add_values, add_voltage
from ...plugins.pybamm.parameter_sets import load, pybamm
from ...plugins.pybamm.state_of_charge import InitialState


@dataclass(frozen=True)
class Hidden:
    """What is true of a cell and is not told.

    Attributes
    ----------
    effects : tuple of Effect
        Effects on top of the base model.
    strengths : mapping of str to float
        Their parameters by full name.
    shifts : mapping of str to float
        Base parameters times factors, particle radii among them.
    noise_v : float
        Standard deviation of the voltage noise, V.
    outside : str
        Name of an effect of `OUTSIDE` that no catalogue has; empty for none.
    outside_strength : float
        Its strength.
    """

    effects: tuple[Effect, ...] = ()
    strengths: Mapping[str, float] = field(default_factory=dict)
    shifts: Mapping[str, float] = field(default_factory=dict)
    noise_v: float = 1e-3
    outside: str = ""
    outside_strength: float = 0.0


def _soc_dependent_resistance(model: Any, strength: float) -> Any:
    """A series resistance that triples towards an empty cell."""
    lithiation = model.variables["Average negative particle stoichiometry"]
    return -strength * model.variables["Current [A]"] * pybamm.exp(-6 * lithiation) * 4


def _saturating_overpotential(model: Any, strength: float) -> Any:
    """An overpotential that saturates with current, as of a rectifying contact."""
    return -strength * pybamm.tanh(model.variables["C-rate"] / 0.3)


def _slow_warburg(model: Any, strength: float) -> Any:
    """A voltage with a memory of twenty minutes, proportional to the smoothed current."""
    state = pybamm.Variable("Smoothed C-rate")
    model.rhs[state] = (model.variables["C-rate"] - state) / 1200
    model.initial_conditions[state] = pybamm.Scalar(0)
    return -strength * state


def _drifting_reference(model: Any, strength: float) -> Any:
    """A voltage that creeps with the logarithm of time, whatever the cell does."""
    return strength * pybamm.log(1 + pybamm.t / 600)


OUTSIDE: dict[str, Callable[[Any, float], Any]] = {
    "soc-dependent-resistance": _soc_dependent_resistance,
    "saturating-overpotential": _saturating_overpotential,
    "slow-memory": _slow_warburg,
    "drifting-reference": _drifting_reference,
}
"""Effects that are in no catalogue: an honest answer to them is `unexplained`."""


@dataclass(frozen=True)
class Leg:
    """One step of a hidden cell's test: a C-rate (positive on discharge) or a voltage to hold.

    Attributes
    ----------
    rate : float, sequence of float or None
        C-rate; a sequence is a drive cycle with one value a second; None holds ``hold_v``.
    seconds : float
        Longest duration.
    until_v : float or None
        Voltage at which it ends.
    until_rate : float or None
        C-rate at which a hold ends.
    period : float
        Sampling interval, s.
    hold_v : float or None
        Voltage to hold.
    """

    rate: float | Sequence[float] | None
    seconds: float
    until_v: float | None = None
    until_rate: float | None = None
    period: float = 10.0
    hold_v: float | None = None


def measure(
    cell: CellModel, hidden: Hidden, legs: Sequence[Leg], soc: float, ambient_k: float | None, rng: np.random.Generator
) -> Trajectory:
    """Run a test on a hidden cell and read the instruments.

    Thirty-point meshes, tolerances of 1e-7, events located by PyBaMM's experiments, samples on the cycler's
    clock, noise, and readings rounded to 0.1 mV and 0.1 mA.
    """
    values = load(cell.parameter_set, cell.overrides)
    state = InitialState(values)
    capacity = float(values["Nominal cell capacity [A.h]"])
    leak = sum(hidden.strengths.get(e.full_name(e.strength), 0.0) for e in hidden.effects if e.name == "self-discharge")
    model = make_model(augmented_cell(cell, hidden.effects))
    change = change_of(targets_named(hidden.shifts), hidden.shifts)
    for name, factor in change.factors.items():
        _shift(values, name, factor)
    for effect in hidden.effects:
        p = effect.values(hidden.strengths)
        add_values(values, part_of(effect), p, 0.0)
        add_voltage(model, part_of(effect), p)
    if hidden.outside:
        extra = OUTSIDE[hidden.outside](model, hidden.outside_strength)
        model.variables["Voltage [V]"] = model.variables["Voltage [V]"] + extra
    values.update(state.concentrations(change, soc))
    values.update({"Lower voltage cut-off [V]": 0.5, "Upper voltage cut-off [V]": 6.0})
    if ambient_k is not None:
        values.update({"Ambient temperature [K]": ambient_k, "Initial temperature [K]": ambient_k})
    simulation = pybamm.Simulation(
        model,
        parameter_values=values,
        experiment=pybamm.Experiment([tuple(_step(leg, capacity, leak) for leg in legs)]),
        var_pts={**model.default_var_pts, **dict.fromkeys(("x_n", "x_s", "x_p", "r_n", "r_p"), 30)},
        solver=pybamm.IDAKLUSolver(rtol=1e-7, atol=1e-8),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        solution = simulation.solve(calc_esoh=False, showprogress=False)
    parts = [part for part in solution.cycles[0].steps if not isinstance(part, pybamm.EmptySolution)]
    time = np.concatenate([part.t for part in parts])
    true_current = np.concatenate([part["Current [A]"].entries for part in parts])
    voltage = np.concatenate([part["Voltage [V]"].entries for part in parts])
    temperature = np.concatenate([part["Volume-averaged cell temperature [K]"].entries for part in parts])
    return _read_instruments(hidden, time, true_current - leak, voltage, temperature, rng)


def _read_instruments(
    hidden: Hidden,
    time: FloatArray,
    current: FloatArray,
    voltage: FloatArray,
    temperature: FloatArray,
    rng: np.random.Generator,
) -> Trajectory:
    for effect in hidden.effects:
        p = effect.values(hidden.strengths)
        if effect.name == "current-gain":
            current = current / p["gain"]
        elif effect.name == "current-offset":
            current = current - p["offset"]
        elif effect.measurement is not None:
            if effect.measurement.clock is not None:
                late = effect.measurement.clock(time, p)
                spread = time + 1e-6 * np.arange(len(time))
                voltage = np.interp(late, spread, voltage)
            if effect.measurement.voltage is not None:
                voltage = effect.measurement.voltage(voltage, current, p)
    voltage = np.round(voltage + rng.normal(0.0, hidden.noise_v, len(voltage)), 4)
    temperature = np.round(temperature + rng.normal(0.0, 0.05, len(temperature)), 2)
    return Trajectory(np.round(time, 4), np.round(current, 4), voltage, temperature)


def _step(leg: Leg, capacity: float, leak: float) -> Any:
    ends = []
    if leg.until_v is not None:
        ends.append(f"{leg.until_v} V")
    if leg.until_rate is not None:
        ends.append(f"{leg.until_rate * capacity} A")
    if leg.hold_v is not None:
        return pybamm.step.voltage(leg.hold_v, duration=leg.seconds, termination=ends, period=leg.period)
    if isinstance(leg.rate, (int, float)):
        current = leg.rate * capacity + leak
        return pybamm.step.current(current, duration=leg.seconds, termination=ends or None, period=leg.period)
    assert leg.rate is not None
    profile = np.asarray(leg.rate, dtype=np.float64) * capacity + leak
    clock = np.arange(len(profile), dtype=np.float64)
    # Of a current that changes sign PyBaMM cannot tell from which side the voltage comes.
    below = [f"< {end}" for end in ends]
    return pybamm.step.current(
        np.column_stack([clock, profile]), duration=clock[-1], period=leg.period, termination=below or None
    )


def _shift(values: Any, name: str, factor: float) -> None:
    value = values[name]
    if callable(value):
        values[name] = lambda *arguments, **keywords: factor * value(*arguments, **keywords)
    else:
        values[name] = factor * value
