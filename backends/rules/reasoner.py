"""From what was read to a change: the smallest one that the inferred slopes say removes the mismatch."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from .reading import Prompt
from .sensitivity import Matrix, Sensitivity, infer

_LONGEST_STEP = 0.5
"""Largest logarithmic change of one parameter in one round."""
_DAMPING, _DAMPING_AFTER_OVERSHOT = 0.03, 0.3
"""Damping of each parameter, relative to its own strength (Marquardt's scaling)."""
_PROBE = 1.1


def propose(prompt: Prompt) -> dict[str, Any]:
    """A reply to the agent's prompt."""
    sensitivity = infer(prompt)
    if not len(sensitivity.mismatch) or not np.any(sensitivity.slopes):
        return _probe(prompt, sensitivity)
    change = _step(prompt, sensitivity)
    if np.max(np.abs(change)) < 1e-5:
        return _probe(prompt, sensitivity)
    return _answer(prompt, sensitivity, change)


def _step(prompt: Prompt, sensitivity: Sensitivity) -> Matrix:
    """Damped, bounded least squares in logarithmic changes, shape (p,)."""
    slopes = sensitivity.slopes / sensitivity.tolerance[:, None]
    mismatch = sensitivity.mismatch / sensitivity.tolerance
    strength = np.linalg.norm(slopes, axis=0)
    # A parameter that seems to do nothing must not be moved far on the strength of noise.
    damping = (_DAMPING_AFTER_OVERSHOT if prompt.overshot else _DAMPING) * np.maximum(strength, 1.0)
    lower = np.full(len(sensitivity.parameters), -_LONGEST_STEP)
    upper = np.full(len(sensitivity.parameters), _LONGEST_STEP)
    for place, name in enumerate(sensitivity.parameters):
        value = prompt.parameters[name]
        if name in prompt.bounds and value > 0:
            low, high = prompt.bounds[name]
            upper[place] = min(upper[place], np.log(high / value))
            lower[place] = max(lower[place], np.log(low / value)) if low > 0 else lower[place]
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
    direction = "raise" if change[main] > 0 else "lower"
    expected = sensitivity.mismatch + sensitivity.slopes @ change
    return {
        "analysis": f"The largest mismatches: {described}.",
        "hypothesis": f"{sensitivity.parameters[main]} is too {'low' if change[main] > 0 else 'high'}: "
        f"it moves {sensitivity.features[main_feature]} most.",
        "updated_params": {
            name: f"*{np.exp(step):.6g}"
            for name, step in zip(sensitivity.parameters, change, strict=True)
            if abs(step) > 1e-5
        },
        "rationale": f"From {sensitivity.source}: {direction} it by {100 * np.expm1(abs(change[main])):.2g} % "
        f"and let the others follow; {sensitivity.features[main_feature]} should go to {expected[main_feature]:+.3g}.",
    }


def _probe(prompt: Prompt, sensitivity: Sensitivity) -> dict[str, Any]:
    """With no slopes to go by, change one parameter and see; each trial in memory moves on to the next."""
    names = sorted(prompt.parameters)
    count = len(prompt.trials)
    name = names[(count // 2) % len(names)]
    factor = _PROBE if count % 2 == 0 else 1.0 / _PROBE
    return {
        "analysis": "Nothing is known of how the parameters act here.",
        "hypothesis": f"{name} may be off.",
        "updated_params": {name: f"*{factor:.4g}"},
        "rationale": "Change it alone and see what it does.",
    }


def perturbations(prompt: Prompt, wanted: int) -> dict[str, Any]:
    """A warm-up design: each parameter alone up, then down, then pairs of neighbours."""
    names = list(prompt.parameters)
    rows: list[dict[str, str]] = [{name: "*1.08"} for name in names]
    rows += [{name: "*0.93"} for name in names]
    rows += [{a: "*1.06", b: "*0.95"} for a, b in pairwise(names)]
    return {"perturbations": rows[:wanted]}
