"""How hard a discovery looks, and what it found."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..effect import Effect
from ..inference.refit import Refit
from ..trajectory import FloatArray
from .explanation import Explanation
from .score import Score

Listener = Callable[[str], None]
"""Told in one line what is being done."""


@dataclass(frozen=True)
class Settings:
    """How hard to look."""

    max_effects: int = 2  # Effects in one explanation at most.
    seed: int = 0  # For the further starts of the base fit.
    # What the base model left of records of the same cell that it was fitted to before, root mean square, V.
    known_v: float = 0.0


@dataclass(eq=False)
class Nomination:
    """An effect of the catalogue and how far it came."""

    effect: Effect
    lacks: str = ""  # Why it was not considered; empty if it was.
    score: Score | None = None
    sensitivity: FloatArray | None = None  # Derivative of the weighted residual by its strength, per probe.
    deviation: FloatArray | None = None  # The standard deviations that the sensitivity is in, V.
    tried: bool = False  # Whether it was given short fits.
    screened: Refit | None = None  # The best of these; none where it could not be simulated.
    temperature_misfit: float = 0.0  # What the temperature adds to that refit's cost.
    beside: tuple[Effect, ...] = ()  # Effects of the explanation that it is added to.

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The explanation that it makes."""
        return (*self.beside, self.effect)

    @property
    def gain(self) -> float:
        """What its score test promises; 0 without one."""
        return 0.0 if self.score is None else self.score.gain

    @property
    def promise(self) -> float:
        """Cost that it is ranked by after its short fit; infinite if that could not be made."""
        return np.inf if self.screened is None else self.screened.cost + self.temperature_misfit


@dataclass(frozen=True)
class Gap:
    """What is to be closed."""

    base: Explanation  # The base model, by its better likelihood.
    # The fit of the base model that comes nearest in root mean square, by which the gap is measured. The likelihood
    # by which ``base`` is the better one is not affected by how far off the few averages are that are far off.
    nearest: Explanation
    # noise_v, held_noise_v: Measurement noise of the fitted records and of the data not fitted, V.
    noise_v: float
    held_noise_v: float
    known_v: float = 0.0  # As in `Settings`.

    @property
    def floor_v(self) -> float:
        """What no effect is asked to explain of the fitted records, V."""
        return self._floor(self.noise_v, self.nearest.rmse_v)

    @property
    def held_floor_v(self) -> float:
        """The same of data not fitted, V."""
        return self._floor(self.held_noise_v, self.base.held_rmse_v)

    def _floor(self, noise_v: float, left_v: float) -> float:
        """Noise, and what the base model is known to lack of the cell, as long as it leaves more than that."""
        floor_v = math.hypot(noise_v, self.known_v)
        return floor_v if left_v > floor_v else noise_v


@dataclass(eq=False)
class Findings:
    """What the engine found."""

    verdict: str  # ``"no-missing-effect"``, ``"effect-found"``, ``"ambiguous"`` or ``"unexplained"``.
    gap: Gap
    best: Explanation  # The best explanation; the base model itself if nothing is missing.
    rivals: list[Explanation] = field(default_factory=list)  # What cannot be told from the best.
    explanations: list[Explanation] = field(default_factory=list)  # All that were fitted until converged, best first.
    nominations: list[Nomination] = field(default_factory=list)  # Every effect of the catalogue.
    reason: str = ""  # Why the verdict is what it is.
    mesh_v: float = 0.0  # Root mean square of the mesh correction, V.

    @property
    def base(self) -> Explanation:
        """The base model."""
        return self.gap.base
