from dataclasses import replace

import numpy as np
import pytest
from bsa.core.contracts.requests import MeasuredRecord
from bsa.core.task import CellModel
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.pybamm.before_search.radial_mesh import radial_mesh
from bsa.plugins.pybamm.modelling.compiled_cell import Start
from bsa.plugins.pybamm.modelling.resolution import Resolution
from bsa.plugins.pybamm.solving.driven_cell import FINE, SEARCH, DrivenCell


def discharge(current, duration):
    time = np.concatenate([np.arange(0.0, 60, 10), 60 + np.linspace(0, duration, 100)])
    amperes = np.concatenate([np.zeros(6), np.full(100, current)])
    steps = (Step(StepKind.REST, 0, 6), Step(StepKind.CC_DISCHARGE, 6, 106))
    return MeasuredRecord("a", Trajectory(time, amperes, np.full(106, 4.0), None, steps), 298.15)


def voltage(cell, measured_record, points):
    driven = DrivenCell(
        cell,
        (),
        measured_record.record,
        {},
        Start(temperature_k=measured_record.ambient_k),
        replace(SEARCH, radial_points=points),
    )
    curve = driven.solve({}, measured_record.record.time, measured_record.record.current, 0.95)
    assert curve is not None
    return curve.voltage


@pytest.mark.slow
def test_where_diffusivity_is_a_constant_the_usual_mesh_is_enough():
    mesh = radial_mesh(CellModel("Chen2020", "SPMe"), [discharge(10.0, 1200.0)])
    assert (mesh.usual, mesh.fine, mesh.note) == (SEARCH, FINE, "")
    assert mesh.shift_v < 0.01


@pytest.fixture(scope="module")
def hindered():
    return CellModel("ORegan2022", "SPMe"), discharge(15.0, 600.0)


@pytest.mark.slow
def test_where_it_varies_by_decades_particles_get_the_points_they_need(hindered):
    cell, measured_record = hindered
    mesh = radial_mesh(cell, [measured_record], {"a": 0.95})
    points = mesh.usual.radial_points
    assert points > 40
    assert mesh.fine.radial_points == 2 * points
    assert mesh.fine.rtol == FINE.rtol
    assert f"{points} mesh points resolve each particle" in mesh.note
    assert f"{1e3 * mesh.shift_v:.0f} mV" in mesh.note
    best = voltage(cell, measured_record, 320)
    # The point of it all: 40 points are tens of millivolts off, and nothing would say so.
    assert np.max(np.abs(voltage(cell, measured_record, 40) - best)) > 0.03
    assert np.sqrt(np.mean((voltage(cell, measured_record, points) - best) ** 2)) < 0.02


@pytest.mark.slow
def test_the_record_with_the_strongest_current_decides(hindered):
    cell, fast = hindered
    slow = discharge(0.25, 900.0)
    assert radial_mesh(cell, [slow], {"a": 0.95}).usual == SEARCH
    assert radial_mesh(cell, [slow, fast], {"a": 0.95}).usual.radial_points > 40


def test_radial_points_leave_the_other_coordinates_alone():
    assert Resolution().mesh() == {}
    assert Resolution(radial_points=80).mesh() == {"r_n": 80, "r_p": 80}
    assert Resolution(points=40, radial_points=160).mesh() == {"x_n": 40, "x_s": 40, "x_p": 40, "r_n": 160, "r_p": 160}
