"""How finely a cell is simulated: mesh and tolerances."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Resolution:
    """Mesh and tolerances of a solve."""

    rtol: float = 1e-5  # Relative tolerance of the integrator.
    points: int | None = None  # Mesh points in every domain; None keeps PyBaMM's own.
    radial_points: int | None = None  # Mesh points in a particle, where it needs others.
    # Whether to use PyBaMM's own mesh, whose lengths are numbers, instead of one whose lengths are inputs.
    standard_mesh: bool = False
    # Of a standard mesh: the logarithm of how much finer a particle's mesh is at its surface than at its centre; 0
    # keeps PyBaMM's own, uniform one.
    radial_stretch: float = 0.0
    least_atol: float = 0.0  # The absolute tolerance is a tenth of the relative one, and at least this.

    @property
    def atol(self) -> float:
        """Absolute tolerance of the integrator."""
        return max(0.1 * self.rtol, self.least_atol)

    def mesh(self) -> dict[str, int]:
        """Mesh points by the name of the coordinate, as PyBaMM's ``var_pts`` has them."""
        radial = self.radial_points or self.points
        chosen = {"x_n": self.points, "x_s": self.points, "x_p": self.points, "r_n": radial, "r_p": radial}
        return {name: count for name, count in chosen.items() if count is not None}


SEARCH = Resolution()
REFERENCE = Resolution(rtol=1e-6, standard_mesh=True)
"""For final scores. At an absolute tolerance of 1e-8 every experiment on Ecker2015 fails in its first rest."""

FINE = Resolution(rtol=1e-7, points=40, standard_mesh=True, least_atol=1e-7)
"""Twice PyBaMM's points: tells the error of the mesh, which falls with the square of the spacing. At an absolute
tolerance of 1e-8 DFN fails where the current first steps."""
