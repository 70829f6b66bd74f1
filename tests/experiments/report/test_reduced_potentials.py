"""What is said of corrections of potentials that are simulated otherwise than they were searched."""

import pytest
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.target import target_named
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Trajectory
from bsa.experiments.report.reduced_potentials import reduced_line
from bsa_toy_cell import toy_task

NAMES = [f"Negative electrode OCP correction at stoichiometry {at} [V]" for at in (0.2, 0.5)]


@pytest.mark.parametrize(("heights", "told"), [((0.0, -0.15), "negative at 0.5: −150 → "), ((0.01, 0.01), "")])
def test_a_correction_that_would_make_a_potential_rise_is_told_with_what_is_simulated(heights, told) -> None:
    """A report gave -0.15 V at its bound, with an interval, for a correction that was simulated as -0.007 V."""
    space = ParameterSpace(tuple(Parameter(name, 0.0, -0.2, 0.2, target=target_named(name)) for name in NAMES))
    nothing = Trajectory(*[[0.0]] * 3)
    task = Task("t", CellModel("Chen2020", "SPM"), space, (Experiment("e", nothing, (("Rest for 1 s",),)),))
    candidate = dict(zip(NAMES, heights, strict=True))
    said = reduced_line(task, candidate, "pybamm")
    assert bool(said) is bool(told)
    # A simulator of another kind may have no such potentials.
    assert reduced_line(task, candidate, "my-sim") == ""
    assert told in said


def test_a_cell_without_such_corrections_has_nothing_to_tell() -> None:
    task = toy_task()
    assert reduced_line(task, task.space.initial, "pybamm") == ""
