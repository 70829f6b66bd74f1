"""What the prompt lets one infer about how each parameter moves each feature."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .reading import DomainRule, Prompt

Matrix = NDArray[np.float64]

_NEAR = 1.5
"""Trials farther than this many typical steps say little about the slope here."""
_ROUNDING = 0.1
"""Typical steps below which a difference between trials is lost in the rounding of the prompt."""
_TRUST_IN_WHAT_WAS_KNOWN = 0.05
"""Weight of the slopes known before, against one of a trial at a middling distance."""

_TYPICAL_TIME_S, _TYPICAL_SHIFT_MV, _TYPICAL_PERCENT = 60.0, 3.0, 2.0
"""Guessed effect of a typical step of a parameter that a rule names."""

TOLERANCES = {"_s": 5.0, "_mv": 2.0, "_pct": 1.0}
"""Mismatch that is as good as none, by the unit at the end of a feature's name, where the task tells no other."""


@dataclass(frozen=True)
class Sensitivity:
    """A linear model of the features around the present values."""

    # parameters, features: Names of the columns and rows.
    parameters: tuple[str, ...]
    features: tuple[str, ...]
    slopes: Matrix  # Change of each feature per typical step of each parameter. Shape (f, p).
    mismatch: Matrix  # The features now. Shape (f,).
    tolerance: Matrix  # What is as good as zero. Shape (f,).
    source: str  # Where the slopes come from, in words.


def infer(prompt: Prompt) -> Sensitivity:
    """Measured effects; rules of thumb for the others; the trials in memory where no effects are told."""
    parameters = tuple(prompt.parameters)
    features = tuple(prompt.features)
    mismatch = np.array([prompt.features[name] for name in features])
    tolerance = np.array([_tolerance(name, prompt) for name in features])
    slopes = _from_rules(prompt.rules, parameters, features)
    source = "domain rules" if np.any(slopes) else "nothing yet"
    for column, parameter in enumerate(parameters):
        effects = prompt.sensitivities.effects.get(parameter)
        if effects:
            # Of a parameter whose effects are told, those left out are the smallest.
            slopes[:, column] = [effects.get(feature, 0.0) for feature in features]
            source = "measured effects"
    changes, responses = _differences(prompt, features)
    # Effects that are told hold the trials already.
    if len(changes) and not prompt.sensitivities.effects:
        slopes = _updated(slopes, changes, responses)
        source += f" and {len(changes)} earlier trials" if np.any(slopes) else ""
    return Sensitivity(parameters, features, slopes, mismatch, tolerance, source)


def _tolerance(feature: str, prompt: Prompt) -> float:
    guessed = next((value for suffix, value in TOLERANCES.items() if feature.endswith(suffix)), 1.0)
    return prompt.tolerances.get(feature, guessed)


def _differences(prompt: Prompt, features: tuple[str, ...]) -> tuple[Matrix, Matrix]:
    """Changes of parameters and features between the earlier trials and now, shapes (k, p) and (k, f)."""
    told = [
        trial
        for trial in prompt.trials
        if all(name in trial.numbers for name in features) and max(map(abs, trial.steps), default=0.0) > 1e-5
    ]
    changes = [np.array(trial.steps) for trial in told]
    responses = [np.array([trial.numbers[name] - prompt.features[name] for name in features]) for trial in told]
    return np.array(changes), np.array(responses)


def _updated(slopes: Matrix, changes: Matrix, responses: Matrix) -> Matrix:
    """The slopes nearest to the given ones that explain the differences, near trials counting most."""
    size = np.linalg.norm(changes, axis=1)
    # Each trial tells a slope along its own direction, equally well however long the step was; a far
    # trial tells it of another place, and in a very near one rounding is larger than the effect.
    weight = 1.0 / (size**2 + _ROUNDING**2) / (1.0 + (size / _NEAR) ** 4)
    weighted = changes * weight[:, None]
    normal = weighted.T @ changes + _TRUST_IN_WHAT_WAS_KNOWN * np.eye(changes.shape[1])
    unexplained = responses - changes @ slopes.T
    return slopes + np.linalg.solve(normal, weighted.T @ unexplained).T


def _from_rules(rules: Sequence[DomainRule], parameters: tuple[str, ...], features: tuple[str, ...]) -> Matrix:
    slopes = np.zeros((len(features), len(parameters)))
    for rule in rules:
        for column, parameter in enumerate(parameters):
            if rule.parameter not in parameter:
                continue
            for row, feature in enumerate(features):
                quantity, effect = next((told for part, told in _QUANTITIES.items() if part in feature), ("", 0.0))
                if quantity in rule.raises:
                    slopes[row, column] = effect
                elif quantity in rule.lowers:
                    slopes[row, column] = -effect
    return slopes


_QUANTITIES = {
    "fade_mismatch": ("fade", _TYPICAL_PERCENT),
    "resistance_mismatch": ("resistance", _TYPICAL_PERCENT),
    "discharge_time": ("discharge_time", _TYPICAL_TIME_S),
    "charge_time": ("charge_time", _TYPICAL_TIME_S),
    "hold_time": ("hold_time", _TYPICAL_TIME_S),
    "current_shift": ("hold_time", _TYPICAL_PERCENT),
    "rest": ("rest_voltage", _TYPICAL_SHIFT_MV),
    "discharge": ("polarisation", -_TYPICAL_SHIFT_MV),
    "shift_mv": ("polarisation", _TYPICAL_SHIFT_MV),
}
"""The quantity of the rules that a feature shows and a typical effect on the feature where it rises, by a part of the
feature's name; the first that it contains counts."""
