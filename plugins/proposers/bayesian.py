"""Bayesian optimisation through Ax: one error, or the errors of charge, current and voltage at once."""

import logging
import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from ...core.comparison.paper_metrics import require_paper
from ...core.extras import require
from ...core.hooks import ProposeContext, RunContext, hookimpl
from ...core.parameters import ParameterSpace
from ...core.proposal import Proposal
from ...core.trajectory import FloatArray
from ...core.trial import Trial
from .trial_errors import finite_errors

_TINY = 1e-6
"""Added to an error before its logarithm is taken, in percent."""


class BayesianOptions(BaseModel, extra="forbid"):
    """Settings of the Bayesian optimisation."""

    seed: int | None = Field(None, ge=0, description="Seed of Ax; the run's (the paper's 1234) if left out.")
    warm_up_per_parameter: int = Field(2, ge=1, description="Sobol points before the model, per parameter.")
    batch: int = Field(1, ge=1, description="Candidates a round once the model is used.")
    logarithm: bool = Field(
        True, description="Whether the model sees the logarithm of the errors, which span four decades."
    )
    quality: str = Field("fast", pattern="^(fast|quality)$", description="Ax's method: fast or quality.")


class BayesianProposer:
    """Sobol points first, then Ax's model-based method, on the unit box.

    Ax's client is rebuilt from the history at every round, so that the answer is a function of the
    history and a resumed run gets the same one. Ax refuses ranges below 1e-5, which a particle radius has
    in metres: on the unit box every parameter has range 1.
    """

    _outcomes: Mapping[str, str] = {"loss": "objective"}
    """Names of the outcomes for Ax, and the metric each stands for."""

    _name = "bo"

    def __init__(self, options: BayesianOptions, context: RunContext) -> None:
        purpose = f'the proposer "{self._name}"'
        self._client_type = require("ax.api.client", "bo", purpose).Client
        self._range = require("ax.api.configs", "bo", purpose).RangeParameterConfig
        # Several runs share the processors; torch's own threads would fight for them, sixty times slower.
        require("torch", "bo", purpose).set_num_threads(1)
        # Ax announces every trial on stderr, once more each time the client is rebuilt.
        require("ax.utils.common.logger", "bo", purpose).set_stderr_log_level(logging.ERROR)
        self._options = options
        self._seed = context.seed if options.seed is None else options.seed

    @hookimpl
    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`."""
        space = context.task.space
        first = not any(trial.phase == "search" for trial in context.trials)
        warm_up = self._options.warm_up_per_parameter * len(space)
        count = min(warm_up if first else self._options.batch, context.simulations_left)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # The Sobol sequence is one whole; asked for in parts by fresh clients it would repeat itself.
            client = self._client(space, warm_up if first else 1)
            if not first:
                self._tell(client, space, context.trials)
            asked = client.get_next_trials(max_trials=count)
        positions = [np.array([float(arm[f"x{axis}"]) for axis in range(len(space))]) for arm in asked.values()]
        return Proposal(
            tuple(space.from_unit(position) for position in positions),
            rationale="Sobol points." if first else "Where the surrogate expects the most.",
            action="sample" if first else "model",
            by_simulations=True,
        )

    def _client(self, space: ParameterSpace, initialization: int) -> Any:
        client = self._client_type(random_seed=self._seed)
        client.configure_experiment(
            name="bsa",
            parameters=[
                self._range(name=f"x{axis}", parameter_type="float", bounds=(0.0, 1.0)) for axis in range(len(space))
            ],
        )
        client.configure_optimization(objective=", ".join(f"-{name}" for name in self._outcomes))
        client.configure_generation_strategy(
            method=self._options.quality,
            initialization_budget=initialization,
            initialization_random_seed=self._seed,
            initialize_with_center=False,
        )
        return client

    def _tell(self, client: Any, space: ParameterSpace, trials: Sequence[Trial]) -> None:
        columns = {outcome: self._errors(trials, metric) for outcome, metric in self._outcomes.items()}
        for row, trial in enumerate(trials):
            position = np.clip(space.to_unit(trial.candidate), 0.0, 1.0)
            number = client.attach_trial({f"x{axis}": float(value) for axis, value in enumerate(position)})
            client.complete_trial(number, raw_data={name: float(column[row]) for name, column in columns.items()})

    def _errors(self, trials: Sequence[Trial], metric: str) -> FloatArray:
        errors = finite_errors(trials, lambda trial: float(getattr(trial.metrics, metric, math.inf)))
        return np.log10(errors + _TINY) if self._options.logarithm else errors


class MultiObjectiveProposer(BayesianProposer):
    """The three errors as objectives of their own: Ax chooses qNEHVI for them (paper, Sec. 4.4).

    Daulton, Balandat & Bakshy, NeurIPS 2021, arXiv:2105.08195.
    """

    _outcomes: Mapping[str, str] = {"q": "q_mape", "i": "i_mape", "v": "v_mape"}
    _name = "qnehvi"

    def __init__(self, options: BayesianOptions, context: RunContext) -> None:
        require_paper(context.task, self._name)
        super().__init__(options, context)
