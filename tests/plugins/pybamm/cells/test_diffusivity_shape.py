"""Diffusivities that change with the stoichiometry: one law in searches, parameter sets and exported scripts."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.target import DiffusivityShape, change_of, target_named
from bsa.core.task import CellModel, Experiment, ParameterFile, Task
from bsa.core.trajectory import Trajectory
from bsa.plugins.pybamm.cells.diffusivity_shape import shaped
from bsa.plugins.pybamm.cells.parameter_sets import bake, initial_value, load, pybamm, target_in
from bsa.plugins.pybamm.export.calibrated_script import parameter_values_json, script
from bsa.plugins.pybamm.solving.compiled import CompiledExperiment
from bsa.plugins.pybamm.solving.experiment_kinds import solve_reference

POSITIVE = "Positive particle diffusivity [m2.s-1]"
NAMES = (
    "Negative particle diffusivity factor at stoichiometry 0.05",
    "Positive particle diffusivity factor at stoichiometry 0.95",
)
TARGETS = {name: target_named(name) for name in NAMES}
CANDIDATE = {NAMES[0]: 3.0, NAMES[1]: 0.2}
NOTHING = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))


def diffusivity(values: object, x: np.ndarray) -> np.ndarray:
    own = values[POSITIVE]  # type: ignore[index]
    symbol = own(pybamm.Vector(x), pybamm.Scalar(298.15)) if callable(own) else pybamm.Scalar(own)
    return np.asarray(values.process_symbol(symbol).evaluate()).ravel()  # type: ignore[attr-defined]


def test_all_of_the_factor_applies_at_its_stoichiometry_and_none_far_from_it() -> None:
    found = shaped(2e-14, {0.95: 0.2})(np.array([0.95, 0.2]), 298.15)
    assert found == pytest.approx([0.4e-14, 2e-14], rel=1e-3, abs=0.0)


@pytest.mark.parametrize("name", ["Chen2020", "ORegan2022"])  # a number, a function
def test_a_set_is_changed_where_the_factor_says(name: str) -> None:
    values, x = load(name), np.array([0.3, 0.9, 0.95])
    before = diffusivity(values, x)
    bake(values, change_of(TARGETS, CANDIDATE))
    ratio = diffusivity(values, x) / before
    assert ratio[2] == pytest.approx(0.2, rel=1e-6)
    assert 0.2 < ratio[1] < ratio[0] <= 1.0


@pytest.mark.slow
def test_one_compiled_model_serves_all_factors() -> None:
    cell = CellModel("Chen2020", "SPM")
    protocol = (("Discharge at 1C for 40 minutes", "Rest for 10 minutes"),)
    experiment = Experiment("short", NOTHING, protocol, initial_soc=0.7)
    compiled = CompiledExperiment(cell, experiment, TARGETS)
    ends = []
    for candidate in (dict.fromkeys(NAMES, 1.0), CANDIDATE):
        ours = compiled.solve(candidate).trajectory
        theirs = solve_reference(cell, experiment, change_of(TARGETS, candidate)).trajectory
        assert ours is not None
        assert theirs is not None
        assert ours.voltage[-1] == pytest.approx(theirs.voltage[-1], abs=2e-3)
        ends.append(np.interp(2400.0, ours.time, ours.voltage))
    assert abs(ends[1] - ends[0]) > 5e-3


def test_the_script_that_stands_alone_and_the_file_of_values_have_the_factor() -> None:
    space = ParameterSpace(tuple(Parameter(name, 1.0, 0.05, 20.0, "log", target=TARGETS[name]) for name in NAMES))
    experiment = Experiment("x", NOTHING, (("Rest for 1 second",),), initial_soc=0.5)
    module: dict[str, object] = {"__name__": "exported"}
    exec(script(Task("t", CellModel("Chen2020"), space, (experiment,)), CANDIDATE), module)
    change = space.change(CANDIDATE)
    text = parameter_values_json(CellModel("Chen2020"), change)
    written = load(ParameterFile("own", "parameter-values", text))
    ours, x = load("Chen2020"), np.linspace(0.1, 0.95, 9)
    bake(ours, change)
    for theirs in (module["parameter_values"](), written):  # type: ignore[operator]
        assert diffusivity(theirs, x) == pytest.approx(diffusivity(ours, x), rel=1e-9, abs=0.0)


def test_a_search_starts_where_nothing_is_changed() -> None:
    assert target_in("Chen2020", NAMES[1]) == DiffusivityShape("Positive", 0.95)
    assert initial_value("Chen2020", NAMES[1]) == 1.0
