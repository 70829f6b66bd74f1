"""From what was read to a change: the smallest one that the inferred slopes say removes the mismatch."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from .coordinates import change_by, to_steps
from .reading import Prompt
from .sensitivity import Matrix, Sensitivity, infer

_LONGEST = 5.0
"""Typical steps that one parameter may move in one round."""
_DAMPING, _DAMPING_AFTER_OVERSHOT = 0.03, 0.3
"""Damping of each parameter, relative to its own strength (Marquardt's scaling)."""


def propose(prompt: Prompt) -> dict[str, Any]:
    """A reply to the agent's prompt."""
    sensitivity = infer(prompt)
    if not len(sensitivity.mismatch) or not np.any(sensitivity.slopes):
        return _probe(prompt)
    change = _step(prompt, sensitivity)
    if np.max(np.abs(change)) < 1e-4:
        return _probe(prompt)
    return _answer(prompt, sensitivity, change)


def _step(prompt: Prompt, sensitivity: Sensitivity) -> Matrix:
    """Damped, bounded least squares, in typical steps of each parameter, shape (p,)."""
    slopes = sensitivity.slopes / sensitivity.tolerance[:, None]
    mismatch = sensitivity.mismatch / sensitivity.tolerance
    strength = np.linalg.norm(slopes, axis=0)
    # A parameter that seems to do nothing must not be moved far on the strength of noise.
    damping = (_DAMPING_AFTER_OVERSHOT if prompt.overshot else _DAMPING) * np.maximum(strength, 0.1)
    lower = np.full(len(sensitivity.parameters), -_LONGEST)
    upper = np.full(len(sensitivity.parameters), _LONGEST)
    for place, name in enumerate(sensitivity.parameters):
        if name in prompt.bounds:
            low, now, high = (
                to_steps(value, prompt.steps[name])
                for value in (prompt.bounds[name][0], prompt.parameters[name], prompt.bounds[name][1])
            )
            lower[place], upper[place] = max(lower[place], low - now), min(upper[place], high - now)
    # A value that lies on its bound leaves no room on one side; lsq_linear wants some.
    upper, lower = np.maximum(upper, 1e-9), np.minimum(lower, -1e-9)
    stacked = np.vstack([slopes, np.diag(damping)])
    target = np.concatenate([-mismatch, np.zeros(len(lower))])
    return np.asarray(lsq_linear(stacked, target, bounds=(lower, upper)).x)


def _answer(prompt: Prompt, sensitivity: Sensitivity, change: Matrix) -> dict[str, Any]:
    strength = np.abs(sensitivity.mismatch) / sensitivity.tolerance
    worst = np.argsort(-strength)[:3]
    described = "; ".join(f"{sensitivity.features[row]} is {sensitivity.mismatch[row]:+.4g}" for row in worst)
    main_feature = int(worst[0])
    effects = sensitivity.slopes[main_feature] * change
    main = int(np.argmax(np.abs(effects))) if np.any(effects) else int(np.argmax(np.abs(change)))
    main_name = sensitivity.parameters[main]
    written = change_by(change[main], prompt.steps[main_name], digits=3)
    expected = sensitivity.mismatch + sensitivity.slopes @ change
    return {
        "analysis": f"The largest mismatches: {described}.",
        "hypothesis": f"{main_name} is too {'low' if change[main] > 0 else 'high'}: "
        f"it moves {sensitivity.features[main_feature]} most.",
        "updated_params": {
            name: change_by(steps, prompt.steps[name])
            for name, steps in zip(sensitivity.parameters, change, strict=True)
            if abs(steps) > 1e-4
        },
        "rationale": f"From {sensitivity.source}: change it by {written} and let the others follow; "
        f"{sensitivity.features[main_feature]} should go to {expected[main_feature]:+.3g}.",
    }


def _probe(prompt: Prompt) -> dict[str, Any]:
    """With no slopes to go by, change one parameter and see; each trial in memory moves on to the next."""
    names = sorted(prompt.parameters)
    if not names:
        return {"analysis": "The prompt names no parameter.", "hypothesis": "", "updated_params": {}, "rationale": ""}
    count = len(prompt.trials)
    name = names[(count // 2) % len(names)]
    return {
        "analysis": "Nothing is known of how the parameters act here.",
        "hypothesis": f"{name} may be off.",
        "updated_params": {name: change_by(1.0 if count % 2 == 0 else -1.0, prompt.steps[name])},
        "rationale": "Change it alone and see what it does.",
    }


def perturbations(prompt: Prompt, wanted: int) -> dict[str, Any]:
    """A warm-up design: each parameter alone up, then down, then pairs of neighbours."""

    def change(name: str, steps: float) -> str:
        return change_by(steps, prompt.steps[name])

    names = list(prompt.parameters)
    rows: list[dict[str, str]] = [{name: change(name, 1.0)} for name in names]
    rows += [{name: change(name, -0.8)} for name in names]
    rows += [{a: change(a, 0.6), b: change(b, -0.6)} for a, b in pairwise(names)]
    return {"perturbations": rows[:wanted]}
