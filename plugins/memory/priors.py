"""Expert knowledge given before the first simulation: bounds and rules of thumb."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from ...core.hooks import NoOptions, Recollection, RunContext, hookimpl
from ...core.prompt_sections import PRIORS, table
from ..feedback.rounding import rounded

_RULES = ("raises", "lowers", "parameters_and_why")


class Priors:
    """Tells the bounds of the searched parameters and the domain rules that mention them."""

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        self._space = context.task.space
        names = self._space.names
        self._rules = [rule for rule in context.task.domain.rules if any(rule["parameter"] in name for name in names)]

    @hookimpl
    def recall(self, budget: int) -> Recollection | None:
        """See `RunHooks.recall`; the agent's prompt moves the bounds into its table of parameters."""
        bounds = rounded({parameter.name: [parameter.lower, parameter.upper] for parameter in self._space})
        rules = list(self._rules)
        content: dict[str, Any] = {"bounds": bounds, "rules": _grouped(rules)}
        while len(json.dumps(content)) > budget and rules:
            rules.pop()
            content["rules"] = _grouped(rules)
        return Recollection(PRIORS, content, priority=1)


def _grouped(rules: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Parameters that raise and lower the same quantities share a row."""
    groups: dict[tuple[str, str], list[list[Any]]] = {}
    for rule in rules:
        groups.setdefault((_told(rule.get("raises")), _told(rule.get("lowers"))), []).append(
            [rule["parameter"], rule.get("why")]
        )
    return table(_RULES, [[*quantities, entries] for quantities, entries in groups.items()])


def _told(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value or "")
