"""The backend that needs nothing: a fresh machine uses it, and says so."""

import json
import time
from collections.abc import Sequence
from typing import Any

from ...core.hooks import NoOptions
from ...core.messages import JsonSchema, Message, Reply, Usage
from .acting import act, act_alone
from .ranking import rank
from .reading import read_prompt
from .reasoner import perturbations, propose


class RulesBackend:
    """Answers from the prompt alone, by linear reasoning over what it says.

    It sees what a language model would see. Without memory it has only the domain rules to go by; with
    scalar feedback only one number; so ablations of either mean something.
    """

    name = "rules"
    sees_images = False

    def __init__(self, options: NoOptions | None = None) -> None:
        pass

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `Backend.complete`."""
        started = time.perf_counter()
        properties: dict[str, Any] = dict(schema.get("properties", {}))
        actions = properties.get("action", {}).get("enum", ())
        if "ranking" in properties:
            answer = rank(messages, int(properties["ranking"].get("maxItems", 1)))
        elif "perturbations" in properties:
            answer = perturbations(read_prompt(messages), int(properties["perturbations"].get("maxItems", 1)))
        elif "refine" in actions:
            answer = act(read_prompt(messages))
        elif actions == ["jacobian"]:
            answer = {"action": "jacobian"}
        elif "jacobian" in actions:
            answer = act_alone(read_prompt(messages))
        else:
            answer = propose(read_prompt(messages))
        usage = Usage(seconds=time.perf_counter() - started)
        return Reply(json.dumps(answer), usage, model="rules", structured_by="schema")

    def close(self) -> None:
        """Nothing to release."""
