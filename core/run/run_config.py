"""What a run is asked to do: the part of its configuration that is not the task or the scaffold."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, Field

from ..scaffold import Scaffold


class RunConfig(BaseModel, extra="forbid"):
    """Everything that, with the task and the code, determines a run's result."""

    scaffold: Scaffold = Field(description="Which plugins take part.")
    backend: str = Field("rules", description="Which language model, as bsa list shows it.")
    backend_options: dict[str, Any] = Field(default_factory=dict, description="Options of the backend.")
    seed: int = Field(1234, ge=0, description="Seed for everything random.")
    rounds: int = Field(
        80, ge=0, description="Rounds of the search at most (the paper's T); samplers and fits do not count in rounds."
    )
    warm_up: int = Field(20, ge=0, description="Warm-up simulations at most (the paper's N_w).")
    simulations: int = Field(100, ge=1, description="Simulations at most, warm-up and initial one included.")
    stop_below: float = Field(0.0, ge=0, description="Stop when the objective falls to this or less.")
    patience: int = Field(
        8,
        ge=1,
        description="Stop after this many rounds without an improvement of 0.1 % of the objective; "
        "samplers, which see no progress, are not stopped.",
    )

    def identity(self, task: dict[str, Any], versions: dict[str, str]) -> str:
        """A hash of what determines the result, 16 hex digits; where a run is executed does not enter."""
        content = {"config": self.model_dump(mode="json"), "task": task, "versions": versions}
        return hash_of(content)


def hash_of(determining: Mapping[str, Any], digits: int = 16) -> str:
    """An identity: a hash, in hex digits, of everything that determines a result."""
    return hashlib.sha256(json.dumps(determining, sort_keys=True).encode()).hexdigest()[:digits]
