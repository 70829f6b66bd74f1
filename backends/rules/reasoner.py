"""From what was read to a change: the smallest one that the inferred slopes say removes the mismatch."""

from itertools import pairwise
from typing import Any

import numpy as np

from ...core.inference.typical_steps import change_by, to_steps
from ...core.sensitivities import linear_change
from .reading import Prompt
from .sensitivity import Matrix, Sensitivity, infer

_LONGEST = 5.0
"""Typical steps, all parameters together, that one round may move."""
_SHRINK = 0.4
"""Share of a change that was no better which the next one may have in length."""
_LEAST = 0.02
"""Typical steps below which a change is lost in the rounding of the prompt."""
_MOST_UNMEASURED = 0.6
"""Share of the simulations left that may go into measuring effects."""
_AS_WRITTEN = {"cc": "CC", "cv": "CV", "pct": "%", "mv": "mV", "k": "K"}
"""Words of a feature's name that people write in another way."""


def propose(prompt: Prompt) -> dict[str, Any]:
    """A reply to the agent's prompt."""
    if prompt.suggested:
        # As a model that follows the digest would answer.
        return {
            "analysis": "",
            "hypothesis": "The suggested change helps.",
            "updated_params": dict(prompt.suggested),
            "rationale": "Taken as it is suggested.",
        }
    sensitivity = infer(prompt)
    if not len(sensitivity.mismatch) or not np.any(sensitivity.slopes):
        return _probe(prompt)
    change = _step(prompt, sensitivity)
    if np.max(np.abs(change)) < 1e-4:
        return _probe(prompt)
    return _answer(prompt, sensitivity, change)


def unmeasured(prompt: Prompt) -> list[str]:
    """Parameters whose effects are worth measuring first: some are told, these are not, and there is room for it."""
    told = prompt.sensitivities.effects
    missing = [name for name in prompt.parameters if name not in told]
    affordable = len(missing) <= _MOST_UNMEASURED * prompt.simulations_left
    return missing if told and affordable else []


def failed_in_a_row(prompt: Prompt) -> list[float]:
    """Lengths of the changes tried from the present values that were no better, in typical steps."""
    tried = {trial.index: trial.steps for trial in prompt.trials if trial.asked_by in ("", "search", "agent")}
    lengths = [float(np.linalg.norm(steps)) for index, steps in tried.items() if index > prompt.present]
    return lengths or ([float(np.linalg.norm(prompt.attempt))] if prompt.attempt else [])


def _step(prompt: Prompt, sensitivity: Sensitivity) -> Matrix:
    """As far as the effects can be trusted, in typical steps of each parameter, shape (p,)."""
    lower = np.full(len(sensitivity.parameters), -np.inf)
    upper = np.full(len(sensitivity.parameters), np.inf)
    for place, name in enumerate(sensitivity.parameters):
        if name in prompt.bounds:
            low, high = (to_steps(bound, prompt.steps[name]) for bound in prompt.bounds[name])
            now = to_steps(prompt.parameters[name], prompt.steps[name])
            lower[place], upper[place] = low - now, high - now
    radius = max(min([_LONGEST, *(_SHRINK * length for length in failed_in_a_row(prompt))]), _LEAST)
    return linear_change(sensitivity.slopes, sensitivity.mismatch, sensitivity.tolerance, lower, upper, radius)


def _answer(prompt: Prompt, sensitivity: Sensitivity, change: Matrix) -> dict[str, Any]:
    strength = np.abs(sensitivity.mismatch) / sensitivity.tolerance
    worst = np.argsort(-strength)[:3]
    named = [in_words(feature) for feature in sensitivity.features]
    described = "; ".join(_told(named[row], "is", sensitivity.mismatch[row], 4) for row in worst)
    main_feature = int(worst[0])
    effects = sensitivity.slopes[main_feature] * change
    main = int(np.argmax(np.abs(effects))) if np.any(effects) else int(np.argmax(np.abs(change)))
    main_name = sensitivity.parameters[main]
    written = change_by(change[main], prompt.steps[main_name], digits=3)
    expected = sensitivity.mismatch + sensitivity.slopes @ change
    return {
        "analysis": f"The largest mismatches: {described}.",
        "hypothesis": f"{main_name} is too {'low' if change[main] > 0 else 'high'}: "
        f'its change moves "{named[main_feature][0]}" most.',
        "updated_params": {
            name: change_by(steps, prompt.steps[name])
            for name, steps in zip(sensitivity.parameters, change, strict=True)
            if abs(steps) > 1e-4
        },
        "rationale": f"From {sensitivity.source}: change it by {written} and let the others follow; "
        f"{_told(named[main_feature], 'should go to', expected[main_feature], 3)}.",
    }


def _told(named: tuple[str, str], verb: str, value: float, digits: int) -> str:
    """``"CC discharge late shift is +12.3 mV"``."""
    words, of_unit = named
    return f"{words} {verb} {value:+.{digits}g} {of_unit}".rstrip()


def in_words(feature: str) -> tuple[str, str]:
    """A feature's name, ``"cc_discharge_at_30_pct_shift_mv"``, as a person reads it, and its unit.

    ``("CC discharge at 30 % shift", "mV")``: every name ends in its unit.
    """
    name, _, of_unit = feature.rpartition("_")
    if not name:
        return feature, ""
    words = [_AS_WRITTEN.get(word, word) for word in name.split("_")]
    return " ".join(words), _AS_WRITTEN.get(of_unit, of_unit)


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
