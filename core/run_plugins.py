"""The plugins of one run behind a typed façade: the rest of the code never touches pluggy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pluggy

from .easing import Easing
from .errors import BsaError
from .feedback import Feedback
from .hooks import PROJECT, ProposeContext, Recollection, RunContext, RunHooks
from .metrics import Metrics
from .parameters import Candidate
from .proposal import Proposal
from .registry import Kind, Registry
from .scaffold import PluginChoice, Scaffold
from .simulation import Outcome
from .task import Experiment, Protocol
from .trial import Trial

_EXACTLY_ONE = ("simulate", "build_feedback", "propose")


class RunPlugins:
    """What takes part in one run.

    Parameters
    ----------
    scaffold : Scaffold
        Which plugins, with which options.
    context : RunContext
        What they may know when they are made.
    registry : Registry
        Where they are found.

    Raises
    ------
    BsaError
        If a plugin does not exist, is configured wrongly, or two implement a hook that takes one.
    """

    def __init__(self, scaffold: Scaffold, context: RunContext, registry: Registry) -> None:
        self._manager = pluggy.PluginManager(PROJECT)
        self._manager.add_hookspecs(RunHooks)
        choices: list[tuple[Kind, PluginChoice]] = [
            ("simulator", scaffold.simulator),
            ("feedback", scaffold.feedback),
            *[("memory", memory) for memory in scaffold.memories],
            ("proposer", scaffold.proposer),
        ]
        if scaffold.warm_up is not None:
            choices.append(("warm-up", scaffold.warm_up))
        for kind, choice in choices:
            options = registry.configure(kind, choice.use, choice.options)
            plugin = registry.get(kind, choice.use).factory(options, context)
            try:
                self._manager.register(plugin, f"{kind} {choice.use}")
            except ValueError:
                raise BsaError(
                    f'scaffold "{scaffold.name}" lists the {kind} "{choice.use}" twice.', "list it once."
                ) from None
        self._check(scaffold)

    def _check(self, scaffold: Scaffold) -> None:
        for name in _EXACTLY_ONE:
            found = [implementation.plugin_name for implementation in getattr(self._hook, name).get_hookimpls()]
            if len(found) != 1:
                raise BsaError(
                    f'scaffold "{scaffold.name}" has {len(found)} plugins that implement "{name}" ({found}), not one.',
                    "a run needs exactly one simulator, one feedback builder and one proposer.",
                )

    @property
    def _hook(self) -> Any:
        return self._manager.hook

    def simulate(
        self, candidates: Sequence[Candidate], exact: bool, report: Callable[[int, Outcome], None]
    ) -> Sequence[Outcome]:
        """See `RunHooks.simulate`."""
        return self._hook.simulate(candidates=candidates, exact=exact, report=report)  # type: ignore[no-any-return]

    def simulate_variant(
        self,
        candidates: Sequence[Candidate],
        experiments: tuple[Experiment, ...],
        report: Callable[[int, Outcome], None],
    ) -> Sequence[Outcome] | None:
        """See `RunHooks.simulate_variant`; None where the simulator knows the task alone."""
        return self._hook.simulate_variant(  # type: ignore[no-any-return]
            candidates=candidates, experiments=experiments, report=report
        )

    def ease(self, easing: Easing) -> tuple[Experiment, ...] | None:
        """See `RunHooks.ease`; None where the simulator cannot."""
        return self._hook.ease(easing=easing)  # type: ignore[no-any-return]

    def next_protocols(self) -> Mapping[str, Protocol]:
        """See `RunHooks.next_protocols`."""
        return self._hook.next_protocols() or {}

    def build_feedback(self, outcome: Outcome, metrics: Metrics | None, index: int) -> Feedback:
        """See `RunHooks.build_feedback`."""
        return self._hook.build_feedback(outcome=outcome, metrics=metrics, index=index) or Feedback()

    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`."""
        return self._hook.propose(context=context) or Proposal((), lost="the proposer had nothing to offer")

    def warm_up(self, context: ProposeContext) -> Proposal | None:
        """See `RunHooks.warm_up`; None where the scaffold has no warm-up."""
        return self._hook.warm_up(context=context)  # type: ignore[no-any-return]

    def recall(self, budget: int) -> list[Recollection]:
        """What the memories contribute, in the scaffold's order."""
        # pluggy calls the last registered first.
        return [section for section in reversed(self._hook.recall(budget=budget)) if section is not None]

    def remember(self, trial: Trial, proposal: Proposal | None) -> None:
        """See `RunHooks.remember`."""
        self._hook.remember(trial=trial, proposal=proposal)

    def export(self, candidate: Candidate) -> Mapping[str, str]:
        """See `RunHooks.export`."""
        return self._hook.export(candidate=candidate) or {}

    def close(self) -> None:
        """See `RunHooks.close`."""
        self._hook.close()
