"""How hard a discovery looks, and what it found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..effect import Effect
from ..trajectory import FloatArray
from .explanation import Explanation
from .refit import Refit
from .score import Score

Listener = Callable[[str], None]
"""Told in one line what is being done."""


@dataclass(frozen=True)
class Settings:
    """How hard to look.

    Attributes
    ----------
    max_effects : int
        Effects in one explanation at most.
    screened : int
        Effects that get a short refit.
    confirmed : int
        Explanations that are fitted on, side by side, until one is settled.
    base_budget, refit_budget : int
        Simulations of the base fit and of each confirmation at most.
    seed : int
        For the second start of the base fit.
    """

    max_effects: int = 2
    screened: int = 6
    confirmed: int = 4
    base_budget: int = 110
    refit_budget: int = 90
    seed: int = 0


@dataclass(eq=False)
class Nomination:
    """An effect of the catalogue and how far it came.

    Attributes
    ----------
    effect : Effect
        The effect.
    lacks : str
        Why it was not considered; empty if it was.
    score : Score or None
        Its score test at the base fit.
    sensitivity : ndarray or None
        Derivative of the weighted residual by its strength, per probe.
    deviation : ndarray or None
        The standard deviations that the sensitivity is in, V.
    screened : Refit or None
        A short refit with it.
    temperature_misfit : float
        What the temperature adds to that refit's cost.
    """

    effect: Effect
    lacks: str = ""
    score: Score | None = None
    sensitivity: FloatArray | None = None
    deviation: FloatArray | None = None
    screened: Refit | None = None
    temperature_misfit: float = 0.0

    @property
    def gain(self) -> float:
        """What its score test promises; 0 without one."""
        return 0.0 if self.score is None else self.score.gain

    @property
    def promise(self) -> float:
        """Cost that it is ranked by after its short refit; infinite if that could not be made."""
        return np.inf if self.screened is None else self.screened.cost + self.temperature_misfit


@dataclass(eq=False)
class Findings:
    """What the engine found.

    Attributes
    ----------
    verdict : str
        ``"no-missing-effect"``, ``"effect-found"``, ``"ambiguous"`` or ``"unexplained"``.
    base, best : Explanation
        The base model and the best explanation (the base model itself if nothing is missing).
    rivals : list of Explanation
        What cannot be told from the best.
    explanations : list of Explanation
        All that were fitted until converged, best first.
    nominations : list of Nomination
        Every effect of the catalogue.
    reason : str
        Why the verdict is what it is.
    mesh_v : float
        Size of the mesh correction, V.
    nearest_base : Explanation
        The fit of the base model that comes nearest in root mean square, by which the gap is measured. The likelihood
        by which ``base`` is the better one is blind to how far off the few averages are that are far off.
    """

    verdict: str
    base: Explanation
    best: Explanation
    rivals: list[Explanation] = field(default_factory=list)
    explanations: list[Explanation] = field(default_factory=list)
    nominations: list[Nomination] = field(default_factory=list)
    reason: str = ""
    mesh_v: float = 0.0
    nearest_base: Explanation = field(init=False)

    def __post_init__(self) -> None:
        self.nearest_base = self.base
