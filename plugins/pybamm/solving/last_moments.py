"""A step that could not be solved: how far it gets before it dies, and which limit is near.

PyBaMM throws away the step in which the integrator gives up. Solved again for shorter and shorter times from
where it began, it shows its last moments, and whether a concentration has run out in them.
"""

import time
from typing import Any

import numpy as np

from ..cells.parameter_sets import pybamm
from ..modelling.compiled_cell import SOLVER_ERRORS

_FIRST_S, _GROWTH, _BISECTIONS = 2.0, 4.0, 4
"""The probe lasts this long, then this many times longer each, and between the last two is halved so often."""

_PATIENCE_S = 3.0
"""Wall time of the whole look; it starts no solve after it."""

_NEARLY = 0.02
"""Surface stoichiometry this close to 0 or 1 has as good as reached it."""

_NEARLY_NO_SALT = 0.1
"""Share of the initial electrolyte concentration below which the salt has as good as run out."""

_VOLTAGE_MARGIN_V = 0.005
"""Volts from a cut-off that are as good as there; a rest or hold beside it is not where it died."""

Window = tuple[float, float]


def last_moments(
    simulation: Any, solution: Any, step: Any, inputs: dict[str, float], window_v: Window
) -> tuple[Any, str]:
    """Look at the step in which a simulation of an experiment died: what of it could be solved, and `nearest_limit`.

    ``simulation`` is built with one model for each step, ``solution`` is what came before the step, and ``inputs`` are
    those of the failed solve. None for the step if nothing of it could be solved.
    """
    began = time.monotonic()
    state = solution.last_state
    part, fails_s = None, float(step.duration)
    length_s = _FIRST_S
    while length_s < fails_s and time.monotonic() - began < _PATIENCE_S:
        found = _advance(simulation, state, step, length_s, inputs)
        if found is None:
            fails_s = length_s
            break
        part = found
        length_s *= _GROWTH
    works_s = 0.0 if part is None else float(part.t[-1] - state.t[-1])
    for _ in range(_BISECTIONS):
        if time.monotonic() - began > _PATIENCE_S:
            break
        middle_s = 0.5 * (works_s + fails_s)
        found = _advance(simulation, state, step, middle_s, inputs)
        if found is None:
            fails_s = middle_s
        else:
            part, works_s = found, middle_s
    return part, nearest_limit(part if part is not None else solution, window_v)


def _advance(simulation: Any, state: Any, step: Any, length_s: float, inputs: dict[str, float]) -> Any:
    """The step's first seconds; None if they cannot be solved or end by an event of their own."""
    try:
        found = solve_step(simulation, state, step, length_s, inputs)
    except SOLVER_ERRORS:
        return None
    return found if found.termination == "final time" else None


def solve_step(simulation: Any, state: Any, step: Any, length_s: float, inputs: dict[str, float]) -> Any:
    """So many seconds of a step from a state, by the model that an experiment's simulation has built for the step."""
    model, solver = simulation._get_built_experiment_model(step), simulation._get_built_experiment_solver(step)
    start_s = float(state.t[-1])
    inputs = simulation._build_experiment_step_inputs(inputs, step, start_s, None, include_temperature=False)
    t_eval, t_interp = step.setup_timestepping(solver, length_s, None)
    mapper = simulation._get_state_mapper_for_solution(state, model)
    return solver.step(
        state, model, length_s, t_eval, t_interp=t_interp, save=False, inputs=inputs, state_mapper=mapper
    )


def nearest_limit(solution: Any, window_v: Window) -> str:
    """Which concentration or voltage limit the last state of a solution is at, in plain words.

    Several are joined by semicolons; where none is near, how far the concentrations are from theirs; empty where nobody
    can tell. ``window_v`` is the lower and upper voltage cut-off, V.
    """
    try:
        return _limit(solution, window_v)
    except (KeyError, ValueError, pybamm.ModelError):
        return ""  # a model that lacks these variables says nothing


def _limit(solution: Any, window_v: Window) -> str:
    said: list[str] = []
    seen: list[str] = []
    for which in ("negative", "positive"):
        surface = _last(solution, f"{which.capitalize()} particle surface stoichiometry")
        lowest, highest = float(surface.min()), float(surface.max())
        seen.append(f"{which} surface stoichiometry {lowest:.2f} to {highest:.2f}")
        if lowest < _NEARLY:
            said.append(f"the surface of the {which} particles is empty of lithium (stoichiometry {lowest:.3f})")
        if highest > 1.0 - _NEARLY:
            said.append(f"the surface of the {which} particles is full of lithium (stoichiometry {highest:.3f})")
    salt = _last(solution, "Electrolyte concentration [mol.m-3]")
    initial = float(np.mean(solution["Electrolyte concentration [mol.m-3]"].entries[..., 0]))
    least = float(salt.min())
    seen.append(f"electrolyte {least:.0f} to {float(salt.max()):.0f} mol/m3")
    if least < _NEARLY_NO_SALT * initial:
        said.append(f"the electrolyte has run out of salt ({least:.0f} mol/m3 at the least)")
    volts = float(np.ravel(_last(solution, "Voltage [V]"))[-1])
    lowest_v, highest_v = window_v
    seen.append(f"{volts:.3f} V")
    if volts <= lowest_v + _VOLTAGE_MARGIN_V:
        said.append(f"the voltage is at its lower end ({volts:.3f} V)")
    elif volts >= highest_v - _VOLTAGE_MARGIN_V:
        said.append(f"the voltage is at its upper end ({volts:.3f} V)")
    return "; ".join(said) or "no limit near: " + ", ".join(seen)


def _last(solution: Any, name: str) -> np.ndarray:
    return np.asarray(solution[name].entries[..., -1])
