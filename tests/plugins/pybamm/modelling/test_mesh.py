"""Tests of the meshes."""

import numpy as np
import pybamm
import pytest
from bsa.plugins.pybamm.modelling.mesh import SymbolicExponential1DSubMesh, submeshes
from bsa.plugins.pybamm.modelling.resolution import Resolution

SIZES = {"particle size": "distribution", "surface form": "algebraic"}


@pytest.mark.parametrize(
    ("resolution", "electrode", "particle", "sizes"),
    [
        (Resolution(), *[pybamm.SymbolicUniform1DSubMesh] * 3),
        (
            Resolution(standard_mesh=True),
            pybamm.Uniform1DSubMesh,
            pybamm.Uniform1DSubMesh,
            pybamm.SymbolicUniform1DSubMesh,
        ),
        (
            Resolution(radial_stretch=2.0),
            pybamm.SymbolicUniform1DSubMesh,
            SymbolicExponential1DSubMesh,
            pybamm.SymbolicUniform1DSubMesh,
        ),
        (
            Resolution(standard_mesh=True, radial_stretch=2.0),
            pybamm.Uniform1DSubMesh,
            pybamm.Exponential1DSubMesh,
            pybamm.SymbolicUniform1DSubMesh,
        ),
    ],
)
def test_a_resolution_chooses_the_meshes(resolution, electrode, particle, sizes):
    chosen = submeshes(pybamm.lithium_ion.SPMe(SIZES), resolution)
    for domain, expected in (
        ("negative electrode", electrode),
        ("positive particle", particle),
        ("positive particle size", sizes),
    ):
        found = chosen[domain]
        assert getattr(found, "submesh_type", found) is expected


@pytest.mark.parametrize("standard", [True, False])
def test_a_stretched_mesh_is_finer_at_the_surface(standard):
    chosen = submeshes(pybamm.lithium_ion.SPM(), Resolution(standard_mesh=standard, radial_stretch=2.0))
    variable = pybamm.standard_spatial_vars.r_n
    mesh = chosen["negative particle"]({variable: {"min": 0.0, "max": 1.0}}, {variable.name: 20})
    widths = mesh.d_edges
    assert (widths[1:] < widths[:-1]).all()
    # The widths shrink by the same ratio from cell to cell.
    assert widths[0] / widths[-1] == pytest.approx(np.exp(2.0 * 19 / 20))


def test_a_symbolic_stretched_mesh_is_that_of_pybamm_in_shares_of_its_length():
    variable = pybamm.standard_spatial_vars.r_n
    radius, points, shape = 5e-6, {variable.name: 20}, {"side": "right", "stretch": 2.0}
    length = pybamm.InputParameter("radius")
    symbolic = SymbolicExponential1DSubMesh({variable: {"min": 0.0, "max": length}}, points, **shape)
    ours = pybamm.Exponential1DSubMesh({variable: {"min": 0.0, "max": radius}}, points, **shape)
    assert symbolic.length == length
    for name in ("edges", "nodes", "d_edges", "d_nodes"):
        assert radius * getattr(symbolic, name) == pytest.approx(getattr(ours, name))
