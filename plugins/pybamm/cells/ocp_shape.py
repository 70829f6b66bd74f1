"""Smooth corrections of the electrodes' open-circuit potentials, held to curves that fall with stoichiometry."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import nnls

from ....core.target import CellChange, DiffusivityShape, OcpShape, Target, ocp_name
from ....core.trajectory import FloatArray

ELECTRODES = ("Negative", "Positive")

GRID: FloatArray = 1.0 / (1.0 + np.exp(-np.linspace(-9.0, 9.0, 4001)))
"""Stoichiometries, dense towards 0 and 1, where open-circuit potentials bend."""

BUMP_WIDTH = 0.9
"""Standard deviation of a bump in ``ln(x / (1 - x))``: in stoichiometry 0.01 at 0.01, 0.15 at 0.2 and 0.22 at 0.5.

Potentials bend in the logarithm of the stoichiometry towards both ends, where the knee of a discharge is made, and
slowly in between. Bumps at 0.01, 0.05, 0.2, 0.5, 0.8, 0.95 and 0.99, 1.4 to 1.7 apart, add up to an even line."""

_CHECKED: FloatArray = 1.0 / (1.0 + np.exp(-np.linspace(-6.0, 6.0, 401)))
"""Where the slope is looked at: from 0.0025 to 0.9975, every 0.0075 in the middle, for potentials have steps."""

_LEAST_SLOPE = 0.1
"""Share of its own slope that a potential keeps: one that is flat would not tell the state of charge any more."""


def bump(stoichiometry: Any, centre: Any, width: float = BUMP_WIDTH) -> Any:
    """A bump of height 1: Gaussian in ``ln(x / (1 - x))``, for arrays and PyBaMM symbols alike."""
    distance = np.log(stoichiometry / (1 - stoichiometry)) - np.log(centre / (1 - centre))
    return np.exp(-0.5 * (distance / width) ** 2)


def corrected(
    potential: Callable[..., Any], heights: Mapping[float, Any], width: float = BUMP_WIDTH
) -> Callable[..., Any]:
    """An open-circuit potential with bumps added to it.

    The potential is a function of the stoichiometry, V; ``heights``, V, are by the stoichiometry of each bump.
    """

    def ocp(stoichiometry: Any) -> Any:
        return sum(
            (height * bump(stoichiometry, centre, width) for centre, height in heights.items()),
            potential(stoichiometry),
        )

    return ocp


def correct(values: Any, heights: Mapping[OcpShape, Any]) -> None:
    """Add bumps to the potentials of a parameter set, in place."""
    for name, own in by_curve(heights).items():
        values.update({name: corrected(values[name], own)})


class OcpCurves:
    """Open-circuit potentials of a parameter set as numbers, before anything of it is opened to the search."""

    def __init__(self, values: Any) -> None:
        from .parameter_sets import pybamm  # which builds on this module

        self._own: dict[str, FloatArray] = {}
        for which in ELECTRODES:
            curve = values.process_symbol(values[ocp_name(which)](pybamm.Vector(GRID))).evaluate()
            self._own[which] = np.asarray(curve, dtype=np.float64).ravel()

    def curve(self, which: str, change: CellChange) -> FloatArray:
        """The potential of an electrode on `GRID` as a candidate changes it, V."""
        heights = by_curve(change.ocp_shape).get(ocp_name(which), {})
        scaled = change.factors.get(ocp_name(which), 1.0) * self._own[which]
        return np.asarray(sum((height * bump(GRID, at) for at, height in heights.items()), scaled))

    def falling(self, change: CellChange) -> CellChange:
        """The change with the nearest heights that leave both potentials falling.

        Nearest in the sum of squares of all heights; heights that already do are left as they are (least distance
        programming: Lawson & Hanson, Solving Least Squares Problems (1974), Ch. 23). Where the set's own potential
        rises, the correction may not raise it further.
        """
        heights = dict(change.ocp_shape)
        for which in ELECTRODES:
            targets = [target for target in heights if target.electrode == which]
            if not targets:
                continue
            room = room_to_rise(self._own[which] * change.factors.get(ocp_name(which), 1.0))
            slopes = slopes_of_bumps(np.array([target.stoichiometry for target in targets]))
            nearest = nearest_within(np.array([heights[target] for target in targets]), slopes, room)
            heights.update(zip(targets, nearest.tolist(), strict=True))
        return replace(change, ocp_shape=heights)


def room_to_rise(potential: FloatArray) -> FloatArray:
    """How steep corrections of a potential, on `GRID`, may rise with stoichiometry, V, where they are looked at."""
    own = np.interp(_CHECKED, GRID, potential)
    return np.asarray((1.0 - _LEAST_SLOPE) * np.maximum(-np.gradient(own, _CHECKED), 0.0))


def slopes_of_bumps(centres: FloatArray, width: float = BUMP_WIDTH) -> FloatArray:
    """Slopes of bumps of height 1 where they are looked at, V; a column for each."""
    return np.column_stack([np.gradient(bump(_CHECKED, centre, width), _CHECKED) for centre in centres])


def keeping_ocp_falling(values: Any, targets: Mapping[str, Target]) -> Callable[[CellChange], CellChange]:
    """`OcpCurves.falling` of a set where a potential's shape is searched; else what changes nothing."""
    if any(isinstance(target, OcpShape) for target in targets.values()):
        return OcpCurves(values).falling
    return lambda change: change


def by_curve(shapes: Mapping[OcpShape, Any] | Mapping[DiffusivityShape, Any]) -> dict[str, dict[float, Any]]:
    """Heights or factors by stoichiometry, by PyBaMM's name of the curve that they shape."""
    found: dict[str, dict[float, Any]] = {}
    for target, value in shapes.items():
        name = target.ocp if isinstance(target, OcpShape) else target.diffusivity
        found.setdefault(name, {})[target.stoichiometry] = value
    return found


def nearest_within(point: FloatArray, rows: FloatArray, room: FloatArray) -> FloatArray:
    """The point nearest to ``point`` at which ``rows @ point <= room``, where ``room >= 0``."""
    left = room - rows @ point
    if np.all(left >= 0.0):
        return point
    dual = np.vstack([-rows.T, -left])
    wanted = np.append(np.zeros(len(point)), 1.0)
    rest = dual @ nnls(dual, wanted)[0] - wanted
    return np.asarray(point - rest[:-1] / rest[-1])
