"""How finely a cell is simulated: mesh and tolerances."""

from __future__ import annotations

from dataclasses import dataclass, replace

_USUAL_POINTS = 20
"""Mesh points of every domain in PyBaMM."""

_RADIAL = 2
_STRETCH = 3.0
"""Under a measured current a particle has so many times the points, and its mesh is finer at the surface than at the
centre by so much (a logarithm).

What a changed current does in its first seconds happens in a fraction of PyBaMM's outermost radial cell, half of which
then acts as a resistance. Errors of the voltage in mV (rms, from 160 points), Chen2020 with SPMe, diffusivities those
of the set and 0.15 times these:

    points, stretch    pulses (0.5C to 6C)    US06 drive cycle    1C           2C
    20, uniform        4.4 and 24             5.6 and 30          0.8 and 13   1.8 and 40
    20, 2              0.9 and 10             1.5 and 12          0.3 and 5    0.5 and 10
    20, 3              0.3 and 4              0.6 and 5           0.4 and 6    0.7 and 6
    40, 3              0.1 and 0.9            0.1 and 1.5         0.1 and 5    0.2 and 1.4

Twice the points take 0 to 10 % more time with SPMe, 25 % with DFN.
"""


@dataclass(frozen=True)
class Resolution:
    """Mesh and tolerances of a solve."""

    rtol: float = 1e-5  # Relative tolerance of the integrator.
    points: int | None = None  # Mesh points in every domain; None keeps PyBaMM's own.
    radial_points: int | None = None  # Mesh points in a particle, where it needs others.
    # Whether to use PyBaMM's own mesh, whose lengths are numbers, instead of one whose lengths are inputs.
    standard_mesh: bool = False
    # Logarithm of how much finer a particle's mesh is at its surface than at its centre; 0 keeps a uniform one.
    radial_stretch: float = 0.0
    least_atol: float = 0.0  # The absolute tolerance is a tenth of the relative one, and at least this.

    @property
    def atol(self) -> float:
        """Absolute tolerance of the integrator."""
        return max(0.1 * self.rtol, self.least_atol)

    def graded(self) -> Resolution:
        """The same with meshes of particles that resolve what a measured current does within seconds."""
        return replace(self, radial_points=_RADIAL * (self.points or _USUAL_POINTS), radial_stretch=_STRETCH)

    def mesh(self) -> dict[str, int]:
        """Mesh points by the name of the coordinate, as PyBaMM's ``var_pts`` has them."""
        radial = self.radial_points or self.points
        chosen = {"x_n": self.points, "x_s": self.points, "x_p": self.points, "r_n": radial, "r_p": radial}
        return {name: count for name, count in chosen.items() if count is not None}


SEARCH = Resolution()
LOW_FIDELITY = Resolution(points=10, radial_points=_USUAL_POINTS)
"""Half of PyBaMM's points, but all of those in the particles: a fit of such a model leads a fit of the one it stands
for. A particle's points decide when its surface is full or empty, and with that when a step ends. Error of the
residuals at the start of a published task, in tolerances (rms), and time of a simulation in that of the full model:

    task (set)                misfit    10 points in a particle    20 points
    regular-15 (Chen2020)     31        2.8, 0.57                  0.25, 0.68
    extreme-158 (Ecker2015)   221       0.52, 0.61                 0.12, 0.78
    regular-146 (Prada2013)   46        15, 0.52                   0.004, 0.63
    extreme-198 (Marquis2019) 30        1.9, 0.41                  0.43, 0.66
    regular-103 (ORegan2022)  60        108, 0.27                  27, 0.47
"""

DRIVEN_LOW_FIDELITY = Resolution(points=6)
"""That of a measured current, where nothing but the voltage depends on the mesh: a third of the points in every domain,
in a quarter to a half of the time. With all of those in the particles the error changes by a sixth at most (fits of
three measured cells). Under a protocol, where a step ends when the salt runs out, fits need more simulations of the
full model with so few."""

REFERENCE = Resolution(rtol=1e-6, standard_mesh=True)
"""For final scores. At an absolute tolerance of 1e-8 every experiment on Ecker2015 fails in its first rest."""

FINE = Resolution(rtol=1e-7, points=40, standard_mesh=True, least_atol=1e-7)
"""Twice PyBaMM's points: tells the error of the mesh, which falls with the square of the spacing. At an absolute
tolerance of 1e-8 DFN fails where the current first steps."""
