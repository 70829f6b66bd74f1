"""Meshes whose lengths are symbols, so that geometry can be searched without a rebuild."""

from __future__ import annotations

from typing import Any

from .parameter_sets import pybamm


def search_submeshes(model: Any) -> dict[str, Any]:
    """The model's submeshes with every uniform one-dimensional mesh made symbolic."""
    return {
        domain: pybamm.SymbolicUniform1DSubMesh if submesh is pybamm.Uniform1DSubMesh else submesh
        for domain, submesh in model.default_submesh_types.items()
    }
