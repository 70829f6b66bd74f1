"""Expert knowledge given before the first simulation: bounds and rules of thumb."""

from __future__ import annotations

import json
from typing import Any

from ...core.hooks import NoOptions, Recollection, RunContext, hookimpl
from ...core.prompt_sections import PRIORS, table
from ..feedback.rounding import rounded

_RULE = ("parameter", "raises", "lowers", "why")


class Priors:
    """Tells the bounds of the searched parameters and the domain rules that mention them."""

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        self._space = context.task.space
        rules = context.task.domain.rules
        self._rules: list[list[Any]] = [
            [_told(rule.get(key)) for key in _RULE] for rule in rules if self._applies(rule["parameter"])
        ]

    def _applies(self, parameter: str) -> bool:
        return any(name.startswith(parameter) for name in self._space.names)

    @hookimpl
    def recall(self, budget: int) -> Recollection | None:
        """See `RunHooks.recall`; the agent's prompt moves the bounds into its table of parameters."""
        bounds = rounded({parameter.name: [parameter.lower, parameter.upper] for parameter in self._space})
        rules = list(self._rules)
        content: dict[str, Any] = {"bounds": bounds, "rules": table(_RULE, rules)}
        while len(json.dumps(content)) > budget and rules:
            rules.pop()
            content["rules"] = table(_RULE, rules)
        return Recollection(PRIORS, content, priority=1)


def _told(value: Any) -> Any:
    return ", ".join(map(str, value)) if isinstance(value, list) else value
