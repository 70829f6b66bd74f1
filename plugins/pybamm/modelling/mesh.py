"""Meshes whose lengths are symbols, so that geometry can be searched without a rebuild."""

from typing import Any, Literal

import numpy as np
from scipy.sparse import csr_matrix, diags, vstack

from ..cells.parameter_sets import pybamm
from .resolution import Resolution


def submeshes(model: Any, resolution: Resolution) -> dict[str, Any]:
    """The model's submeshes as a resolution asks for them: uniform ones made symbolic, unless a standard mesh is asked.

    Those of particles are finer towards the surface as far as the resolution asks. Those of particle sizes are symbolic
    in any case: an effect may search their range.
    """

    def chosen(domain: str, submesh: Any) -> Any:
        if submesh is not pybamm.Uniform1DSubMesh:
            return submesh
        symbolic = not resolution.standard_mesh
        if resolution.radial_stretch and domain.endswith("particle"):
            graded = SymbolicExponential1DSubMesh if symbolic else pybamm.Exponential1DSubMesh
            return pybamm.MeshGenerator(graded, {"side": "right", "stretch": resolution.radial_stretch})
        return pybamm.SymbolicUniform1DSubMesh if symbolic or domain.endswith("particle size") else submesh

    return {domain: chosen(domain, submesh) for domain, submesh in model.default_submesh_types.items()}


def search_spatial_methods(model: Any) -> dict[str, Any]:
    """The model's spatial methods with every plain finite-volume method made consistent on symbolic meshes."""
    return {
        domain: SymbolicFiniteVolume(method.options) if type(method) is pybamm.FiniteVolume else method
        for domain, method in model.default_spatial_methods.items()
    }


class SymbolicExponential1DSubMesh(pybamm.SymbolicUniform1DSubMesh):  # type: ignore[misc]
    """``pybamm.Exponential1DSubMesh`` with a length that is a symbol: its edges are shares of that length."""

    def __init__(self, lims: dict[Any, Any], npts: dict[str, int], **shape: Any) -> None:
        super().__init__(dict(lims), npts)
        (variable,) = (name for name in lims if name != "tabs")
        shares = pybamm.Exponential1DSubMesh({variable: {"min": 0.0, "max": 1.0}}, npts, **shape)
        self.edges, self.nodes = shares.edges, shares.nodes
        self.d_edges, self.d_nodes = shares.d_edges, shares.d_nodes


class SymbolicFiniteVolume(pybamm.FiniteVolume):  # type: ignore[misc]
    """Finite volumes with correct arithmetic means on symbolic meshes.

    ``pybamm.FiniteVolume`` weights an arithmetic mean from nodes to edges by ``submesh.d_edges``. A mesh combined from
    symbolic submeshes has edges in local coordinates, ``0..1, ..1, ..1``, so the first cell of each later submesh gets
    the width ``h - 1`` and both edges of that cell get values of the wrong place. The conductivity in the electrolyte
    current is one such mean. Here the weights come from the physical widths, so they follow geometry inputs.
    """

    def shift(
        self,
        discretised_symbol: pybamm.Symbol,
        shift_key: Literal["node to edge", "edge to node"],
        method: Literal["arithmetic", "harmonic"],
    ) -> pybamm.Symbol:
        """Move a discretised symbol between nodes and edges; see ``pybamm.FiniteVolume.shift``."""
        domain = discretised_symbol.domain
        if (
            discretised_symbol.size == 1
            or shift_key != "node to edge"
            or method != "arithmetic"
            # within one submesh the length cancels from the weights
            or len(domain) == 1
            or not hasattr(self.mesh[domain], "length")
        ):
            return super().shift(discretised_symbol, shift_key, method)
        return self._arithmetic_mean_on_edges(discretised_symbol)

    def _arithmetic_mean_on_edges(self, nodal: pybamm.Symbol) -> pybamm.Symbol:
        """Interpolate a symbol on the nodes linearly to the edges of a mesh of several symbolic submeshes."""
        submesh = self.mesh[nodal.domain]
        n = submesh.npts
        repeats = self._get_auxiliary_domain_repeats(nodal.domains)

        def block(sub_matrix: csr_matrix) -> pybamm.Matrix:
            return pybamm.Matrix(self._block_diagonal(sub_matrix, repeats))

        # Constant part: the node left of each interior edge, and the extrapolation to
        # the two exterior edges, whose nodes share a submesh so that lengths cancel
        first = 0.5 * submesh.d_edges[0] / submesh.d_nodes[0]
        last = 0.5 * submesh.d_edges[-1] / submesh.d_nodes[-1]
        base = vstack(
            [
                csr_matrix(([1 + first, -first], ([0, 0], [0, 1])), shape=(1, n)),
                diags([1.0], [0], shape=(n - 1, n)),
                csr_matrix(([-last, 1 + last], ([0, 0], [n - 2, n - 1])), shape=(1, n)),
            ]
        )
        # Symbolic part: the weighted jump across each interior edge
        jump = vstack([csr_matrix((1, n)), diags([-1.0, 1.0], [0, 1], shape=(n - 1, n)), csr_matrix((1, n))])
        d_edges = self._get_d_edges_symbolic_mesh(nodal.domain)
        left = pybamm.Matrix(csr_matrix(diags([1.0], [0], shape=(n - 1, n)))) @ d_edges
        right = pybamm.Matrix(csr_matrix(diags([1.0], [1], shape=(n - 1, n)))) @ d_edges
        # the exterior edges have no jump, so any weight does
        weight = pybamm.numpy_concatenation(
            pybamm.Vector(np.zeros(1)), left / (left + right), pybamm.Vector(np.zeros(1))
        )
        return block(base) @ nodal + self._repeat_vector(weight, repeats) * (block(jump) @ nodal)
