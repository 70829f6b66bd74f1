"""Corrections of open-circuit potentials: as heights say, and never a curve that rises."""

from __future__ import annotations

import numpy as np
import pytest
from bsa.core.target import CellChange, OcpShape, change_of, target_named
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import Trajectory
from bsa.plugins.pybamm.cells.ocp_shape import ELECTRODES, GRID, OcpCurves, bump
from bsa.plugins.pybamm.cells.parameter_sets import bake, load, pybamm
from bsa.plugins.pybamm.export.calibrated_script import script
from bsa.plugins.pybamm.solving.compiled import CompiledExperiment
from bsa.plugins.pybamm.solving.experiment_kinds import solve_reference
from hypothesis import given, settings
from hypothesis import strategies as st

SHAPES = tuple(OcpShape(which, at) for which in ELECTRODES for at in (0.05, 0.2, 0.5, 0.8, 0.95))
NAMES = tuple(
    f"{shape.electrode} electrode OCP correction at stoichiometry {shape.stoichiometry:g} [V]" for shape in SHAPES
)
CURVES = {name: OcpCurves(load(name)) for name in ("Chen2020", "Ai2020", "Prada2013")}
INSIDE = (GRID > 0.02) & (GRID < 0.98)


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(sorted(CURVES)), st.lists(st.floats(-0.15, 0.15), min_size=10, max_size=10))
def test_no_correction_makes_a_potential_rise(name: str, heights: list[float]) -> None:
    curves = CURVES[name]
    kept = curves.falling(CellChange(ocp_shape=dict(zip(SHAPES, heights, strict=True))))
    for which in ELECTRODES:
        own, corrected = (_rise_v(curves.curve(which, change)[INSIDE]) for change in (CellChange(), kept))
        assert corrected <= own + 5e-4


def _rise_v(potential: np.ndarray) -> float:
    """How far a curve climbs above where it has been."""
    return float(np.max(potential - np.minimum.accumulate(potential)))


def test_heights_that_keep_a_potential_falling_stay_as_they_are() -> None:
    change = CellChange(ocp_shape={OcpShape("Positive", 0.5): 0.01, OcpShape("Positive", 0.7): 0.005})
    assert CURVES["Chen2020"].falling(change) == change


def test_the_nearest_falling_curve_is_kept_in_part() -> None:
    # Raising graphite's plateau in its middle alone would make it rise before that.
    kept = CURVES["Ai2020"].falling(CellChange(ocp_shape={shape: 0.05 * (shape == SHAPES[2]) for shape in SHAPES}))
    assert 0.0 < kept.ocp_shape[SHAPES[2]] < 0.05
    # The bump before it has been raised to support it.
    assert kept.ocp_shape[SHAPES[1]] > 0.0


def test_heights_are_added_to_the_potential_of_the_set() -> None:
    values = load("Chen2020")
    x = pybamm.Vector(np.linspace(0.3, 0.9, 7))
    name = "Positive electrode OCP [V]"
    before = values.process_symbol(values[name](x)).evaluate()
    bake(values, CellChange(ocp_shape={OcpShape("Positive", 0.5): 0.01}))
    after = values.process_symbol(values[name](x)).evaluate()
    assert after - before == pytest.approx(0.01 * bump(np.linspace(0.3, 0.9, 7), 0.5)[:, None], abs=1e-12)


@pytest.fixture(scope="module")
def shaped() -> tuple[Experiment, CompiledExperiment]:
    protocol = (("Discharge at 1C for 10 minutes", "Rest for 10 minutes"),)
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    experiment = Experiment("short", nothing, protocol, initial_soc=0.8)
    return experiment, CompiledExperiment(
        CellModel("Chen2020", "SPM"), experiment, {key: target_named(key) for key in NAMES}
    )


@pytest.mark.slow
def test_one_compiled_model_serves_all_shapes(shaped: tuple[Experiment, CompiledExperiment]) -> None:
    experiment, compiled = shaped
    rng = np.random.default_rng(0)
    for heights in (np.zeros(10), rng.normal(0.0, 0.01, 10), rng.normal(0.0, 0.05, 10)):
        candidate = dict(zip(NAMES, heights.tolist(), strict=True))
        ours = compiled.solve(candidate).trajectory
        change = change_of({key: target_named(key) for key in NAMES}, candidate)
        theirs = solve_reference(CellModel("Chen2020", "SPM"), experiment, change).trajectory
        assert ours is not None
        assert theirs is not None
        ends = [ours.voltage[[0, -1]], theirs.voltage[[0, -1]]]
        assert ends[0] == pytest.approx(ends[1], abs=2e-3)


def test_the_script_that_stands_alone_has_the_correction() -> None:
    from bsa.core.parameters import Parameter, ParameterSpace
    from bsa.core.target import target_named
    from bsa.core.task import Task

    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    experiment = Experiment("x", nothing, (("Rest for 1 second",),), initial_soc=0.5)
    space = ParameterSpace(tuple(Parameter(name, 0.0, -0.06, 0.06, target=target_named(name)) for name in NAMES))
    candidate = dict.fromkeys(NAMES, 0.0) | {NAMES[7]: 0.01, NAMES[8]: 0.01}
    module: dict[str, object] = {"__name__": "exported"}
    exec(script(Task("t", CellModel("Chen2020"), space, (experiment,)), candidate), module)
    theirs = module["parameter_values"]()  # type: ignore[operator]
    ours = load("Chen2020")
    bake(ours, space.change(candidate))
    for which in ELECTRODES:
        x = pybamm.Vector(np.linspace(0.1, 0.9, 9))
        name = f"{which} electrode OCP [V]"
        found, wanted = (values.process_symbol(values[name](x)).evaluate() for values in (theirs, ours))
        assert found == pytest.approx(wanted, abs=1e-12)
