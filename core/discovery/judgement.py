"""What a fit leaves: adequacy, errors on fitted and on held-out data, estimates with intervals."""

from collections.abc import Sequence

import numpy as np

from ..contracts.requests import Prediction
from ..effect import Effect
from ..inference.adequacy import judge
from ..inference.observations import freedom_of_deviations
from ..inference.problem import Problem
from ..inference.refit import Refit
from ..rms import rms
from ..trajectory import FloatArray
from .explanation import Explanation, estimates_of, temperature_misfit
from .rules import bic_difference


def explain(problem: Problem, effects: tuple[Effect, ...], fit: Refit) -> Explanation:
    """A fit with its judgement: adequacy, errors on fitted and held-out data, estimates with intervals."""
    predictions = problem.predict(effects, fit.candidate)
    assert predictions is not None, "a fit ends where it could be simulated"
    volts, sigmas = problem.fitted_errors(predictions), problem.sigmas
    sigma = np.concatenate(sigmas)
    steps = np.cumsum(np.concatenate([np.diff(one.step, prepend=-1) != 0 for one in problem.stretches]))
    adequacy = judge(volts / sigma, steps, fit.taken, freedom_of_deviations(problem.stretches, sigmas))
    counts = np.concatenate([one.count for one in problem.stretches])
    rmse = _sample_rmse(volts, counts, problem.noise_v)
    held_rmse, held_errors = _held(problem, effects, fit)
    kelvin = _temperature_error(problem, predictions)
    explanation = Explanation(effects, fit, adequacy, rmse, held_rmse, volts, sigma, kelvin, held_errors=held_errors)
    systematic = problem.systematic() / problem.deviation()[:, None]
    explanation.estimates = estimates_of(effects, fit, explanation.dispersion(problem.misfit_v), systematic)
    for effect in effects if kelvin is not None else ():
        if explanation.estimates[effect.key][0].holds_null:
            off = {effect.full_name(effect.strength): effect.strength.null}
            without = _temperature_error_at(problem, effects, fit.candidate | off)
            if without is not None:
                explanation.temperature_without_k[effect.key] = without
    return explanation


def temperature_misfit_of(problem: Problem, effects: Sequence[Effect], candidate: dict[str, float]) -> float:
    """What the error of the predicted temperature adds to a candidate's cost; 0 where none was measured."""
    if all(observed.temperature is None for observed in problem.observations):
        return 0.0
    return temperature_misfit(_temperature_error_at(problem, effects, candidate))


def _held(problem: Problem, effects: tuple[Effect, ...], fit: Refit) -> tuple[float, tuple[FloatArray, ...]]:
    """Error on all data that was not fitted, over single samples, and the errors of each hold-out record, V."""
    held = problem.held_out(effects, fit.candidate)
    if not held:  # One failed, or nothing is held out, as in a first cycle of few averages.
        return float("inf"), ()
    errors = [error for _, error in held]
    counts = np.concatenate([observed.count for observed, _ in held])
    of_records = tuple(errors[len(errors) - len(problem.held_observations) :])
    return _sample_rmse(np.concatenate(errors), counts, problem.held_noise_v), of_records


def errors_in_words(explanation: Explanation) -> str:
    """Errors on the fitted and on the held-out data, if there are any, and whether the fit has converged."""
    fitted_mv, held_mv = 1e3 * explanation.rmse_v, 1e3 * explanation.held_rmse_v
    held = f", held out {held_mv:.2f} mV" * bool(np.isfinite(held_mv))
    return f"{fitted_mv:.2f} mV{held}" + " (not converged)" * (not explanation.settled)


def against(base: Explanation, explanation: Explanation) -> str:
    """How likely an explanation is beside the base model: the difference in BIC, and why the error may differ."""
    margin = round(bic_difference(base, explanation))
    if margin == 0:
        return "BIC as that of the base model"
    farther = margin > 0 and round(1e3 * explanation.rmse_v, 2) > round(1e3 * base.rmse_v, 2)
    why = ", though the error is larger than the base model's: a few large errors count little in BIC" * farther
    return f"BIC {'better' if margin > 0 else 'worse'} by {abs(margin)}{why}"


def _temperature_error(problem: Problem, predictions: Sequence[Prediction]) -> float | None:
    """Error of the temperature over all fitted records that have one, K."""
    errors = list(problem.temperature_errors(predictions).values())
    return rms(np.concatenate(errors)) if errors else None


def _temperature_error_at(problem: Problem, effects: Sequence[Effect], candidate: dict[str, float]) -> float | None:
    predictions = problem.predict(effects, candidate)
    return None if predictions is None else _temperature_error(problem, predictions)


def _sample_rmse(errors: FloatArray, counts: FloatArray, noise: float) -> float:
    """Error over single samples, from errors of averages: averaging n samples hid noise^2 (1 - 1/n)."""
    squares = errors**2 + noise**2 * (1 - 1 / counts)
    return float(np.sqrt(np.sum(counts * squares) / np.sum(counts)))
