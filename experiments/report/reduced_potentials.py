"""Corrections of open-circuit potentials that are simulated otherwise than they were searched."""

from ...core.parameters import Candidate
from ...core.target import OcpShape
from ...core.task import Task
from .wording import number

_SEEN_V = 1e-3
"""Less than a usual cycler shows is not told."""


def reduced_line(task: Task, candidate: Candidate, simulator: str) -> str:
    """Which corrections a simulation changes so that the potentials fall with stoichiometry; empty for none.

    Only PyBaMM's does: another ``simulator`` may have no such potentials.
    """
    if simulator != "pybamm" or not any(isinstance(parameter.target, OcpShape) for parameter in task.space):
        return ""
    from ...plugins.pybamm.cells.parameter_sets import as_simulated

    asked = task.space.change(candidate)
    heights = as_simulated(task.cell, asked).ocp_shape
    told = [
        f"{one.electrode.lower()} at {one.stoichiometry:g}: {number(1e3 * value, 3)} → "
        f"{number(1e3 * heights[one], 3)} mV"
        for one, value in asked.ocp_shape.items()
        if abs(heights[one] - value) > _SEEN_V
    ]
    if not told:
        return ""
    return (
        "Open-circuit potentials have to fall with stoichiometry. Corrections that would not let them are simulated as "
        f"the nearest that do (electrode at stoichiometry: fit → simulated): {'; '.join(told)}."
    )
