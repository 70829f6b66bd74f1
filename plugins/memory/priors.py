"""Expert knowledge given before the first simulation: bounds and rules of thumb."""

from __future__ import annotations

from typing import Any

from ...core.hooks import NoOptions, Recollection, RunContext, hookimpl
from ...core.prompt_sections import PRIORS
from ..feedback.rounding import rounded


class Priors:
    """Tells the bounds of the searched parameters and the domain rules that mention them."""

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        self._space = context.task.space
        rules = context.task.domain.rules
        self._rules: list[dict[str, Any]] = [dict(rule) for rule in rules if self._applies(rule["parameter"])]

    def _applies(self, parameter: str) -> bool:
        return any(name.startswith(parameter) for name in self._space.names)

    @hookimpl
    def recall(self, budget: int) -> Recollection | None:
        """See `RunHooks.recall`."""
        bounds = {parameter.name: [parameter.lower, parameter.upper] for parameter in self._space}
        content = {"bounds": rounded(bounds), "rules": list(self._rules)}
        while len(str(content)) > budget and content["rules"]:
            content["rules"] = list(content["rules"])[:-1]
        return Recollection(PRIORS, content, priority=1)
