"""The plugins of one run behind a typed façade: what they are asked, and what they answer, is checked here."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import pluggy

from ..contracts import products
from ..contracts.border import Unfit, border
from ..contracts.hook_methods import call, hook_methods
from ..contracts.registry import Registry
from ..errors import BsaError
from ..feedback import Feedback
from ..hooks import ProposeContext, Recollection, RunContext, RunHooks
from ..messages import BackendFailure
from ..metrics import Metrics
from ..parameters import Candidate
from ..proposal import Proposal
from ..scaffold import Part, Scaffold
from ..simulation import Outcome, in_order
from ..task import Experiment, Protocol, Task
from ..task_reduction import TaskReduction
from ..trial import Trial

T = TypeVar("T")

_MAIN_HOOK: dict[Part, str] = {
    "simulator": "simulate",
    "feedback": "build_feedback",
    "memory": "recall",
    "proposer": "propose",
    "warm-up": "warm_up",
}
"""What a plugin of each kind is there for."""

_BROADCAST = ("recall", "remember", "close")
"""Hooks that every plugin may implement; each of the others has one answer."""


@dataclass(frozen=True, eq=False)
class Participant:
    """A plugin of a run."""

    who: str  # Kind, name, distribution and version.
    hooks: Mapping[str, pluggy.HookImpl]  # What it implements.

    def call(self, hook: str, **arguments: Any) -> Any:
        """Call one of its hooks, with those arguments that it names."""
        with border(self.who, hook):
            return call(self.hooks[hook], arguments)


class RunPlugins:
    """What takes part in one run.

    ``note`` is told in one line what was left out of a plugin's answers. Raises `BsaError` if a plugin does not exist,
    is configured wrongly, has methods that would never be called, or two implement a hook that takes one; during the
    run, if a plugin raises, or answers what its hook does not promise.
    """

    def __init__(
        self,
        scaffold: Scaffold,
        context: RunContext,
        registry: Registry,
        note: Callable[[str], None] = lambda text: None,
    ) -> None:
        self._scaffold, self._registry = scaffold, registry
        self._context, self._note = context, note
        self._noted: set[str] = set()
        self._participants: list[Participant] = []
        for place, (kind, choice) in enumerate(scaffold.parts):
            if any((kind, choice.use) == (other, earlier.use) for other, earlier in scaffold.parts[:place]):
                raise BsaError(f'scaffold "{scaffold.name}" lists the {kind} "{choice.use}" twice.', "list it once.")
        self._make()

    def go_over_to(self, task: Task) -> None:
        """Close the plugins and make them anew for another task: the one that a search has left."""
        self.close()
        self._context = replace(self._context, task=task)
        self._make()

    def _make(self) -> None:
        self._participants = []
        try:
            for kind, choice in self._scaffold.parts:
                plugin = self._registry.make(kind, choice.use, choice.options, self._context)
                self._participants.append(_participant(plugin, kind, self._registry.find(kind, choice.use).who))
            self._check_alone()
        except BaseException:
            # What was made before may hold processes and files.
            self.close()
            raise

    def _check_alone(self) -> None:
        for hook in (name for name in vars(RunHooks) if not name.startswith("_") and name not in _BROADCAST):
            found = [participant.who for participant in self._with(hook)]
            if len(found) > 1:
                raise BsaError(
                    f'scaffold "{self._scaffold.name}" has {len(found)} plugins that implement "{hook}" '
                    f"({', '.join(found)}), not one.",
                    "leave one of them out.",
                )

    def _with(self, hook: str) -> list[Participant]:
        return [participant for participant in self._participants if hook in participant.hooks]

    def _only(self, hook: str) -> Participant | None:
        return next(iter(self._with(hook)), None)

    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterator[tuple[int, Outcome]]:
        """See `RunHooks.simulate`."""
        simulator = self._only("simulate")
        assert simulator is not None  # `_participant` has checked that the plugin of this kind has it
        pairs = simulator.call("simulate", candidates=[dict(candidate) for candidate in candidates], exact=exact)
        return self._outcomes(simulator, "simulate", pairs, len(candidates), self._context.task.experiments)

    def _outcomes(
        self, simulator: Participant, hook: str, pairs: object, candidates: int, experiments: Sequence[Experiment]
    ) -> Iterator[tuple[int, Outcome]]:
        task = self._context.task
        signals = [[signal.name for signal in task.signals_of(experiment)] for experiment in experiments]
        checked = products.outcomes(pairs, candidates, experiments, signals)
        while True:
            with border(simulator.who, hook):
                pair = next(checked, None)
            if pair is None:
                return
            yield pair

    def simulate_finer(self, candidate: Candidate) -> Outcome | None:
        """See `RunHooks.simulate_finer`; None where the simulator has one mesh."""
        hook, simulator = "simulate_finer", self._only("simulate_finer")
        outcome = simulator and simulator.call(hook, candidate=dict(candidate))
        if simulator is None or outcome is None:
            return None
        ((_, checked),) = self._outcomes(simulator, hook, [(0, outcome)], 1, self._context.task.experiments)
        return checked

    def simulate_variant(
        self, candidates: Sequence[Candidate], experiments: tuple[Experiment, ...], exact: bool = False
    ) -> Iterator[tuple[int, Outcome]] | None:
        """See `RunHooks.simulate_variant`; None where the simulator knows the task alone."""
        return self._optional_outcomes("simulate_variant", candidates, experiments=experiments, exact=exact)

    def equilibrium(self, candidates: Sequence[Candidate]) -> list[Outcome] | None:
        """See `RunHooks.equilibrium`; in the order of the candidates, None where the simulator has none."""
        found = self._optional_outcomes("equilibrium", candidates)
        return None if found is None else in_order(found)

    def simulate_low_fidelity(self, candidates: Sequence[Candidate]) -> Iterator[tuple[int, Outcome]] | None:
        """See `RunHooks.simulate_low_fidelity`; None where the simulator has no such model of the task."""
        return self._optional_outcomes("simulate_low_fidelity", candidates)

    def _optional_outcomes(
        self, hook: str, candidates: Sequence[Candidate], **more: Any
    ) -> Iterator[tuple[int, Outcome]] | None:
        """Outcomes of the ``experiments`` that are among the further arguments, else of those of the task."""
        simulator = self._only(hook)
        pairs = simulator and simulator.call(hook, candidates=[dict(candidate) for candidate in candidates], **more)
        if simulator is None or pairs is None:
            return None
        experiments = more.get("experiments", self._context.task.experiments)
        return self._outcomes(simulator, hook, pairs, len(candidates), experiments)

    def _optional(self, hook: str, check: Callable[[Any], T], **arguments: Any) -> T:
        """The checked answer of the plugin that implements the hook; that of none is None."""
        participant = self._only(hook)
        if participant is None:
            return check(None)
        found = participant.call(hook, **arguments)
        with border(participant.who, hook):
            return check(found)

    def reduce_task(self, reduction: TaskReduction) -> tuple[Experiment, ...] | None:
        """See `RunHooks.reduce_task`; None where the simulator cannot."""
        count = len(self._context.task.experiments)
        return self._optional("reduce_task", lambda found: products.experiments(found, count), reduction=reduction)

    def next_protocols(self) -> Mapping[str, Protocol]:
        """See `RunHooks.next_protocols`."""
        return self._optional("next_protocols", products.protocols)

    def weighs_priors(self) -> bool:
        """See `RunHooks.weighs_priors`."""
        return self._optional("weighs_priors", products.yes_or_no)

    def build_feedback(self, outcome: Outcome, metrics: Metrics | None, index: int) -> Feedback:
        """See `RunHooks.build_feedback`."""
        return self._optional(
            "build_feedback",
            lambda found: products.feedback(found, self._context.folder),
            outcome=outcome,
            metrics=metrics,
            index=index,
        )

    def propose(self, context: ProposeContext) -> Proposal:
        """See `RunHooks.propose`; a lost call that the proposer lets pass is a lost round."""
        return self._proposed("propose", lambda found: products.proposal(found, context.task.space), context)

    def warm_up(self, context: ProposeContext) -> Proposal | None:
        """See `RunHooks.warm_up`; None where the scaffold has no warm-up."""

        def check(found: Any) -> Proposal | None:
            return None if found is None else products.proposal(found, context.task.space)

        return self._proposed("warm_up", check, context)

    def _proposed(self, hook: str, check: Callable[[Any], T], context: ProposeContext) -> T | Proposal:
        try:
            return self._optional(hook, check, context=context)
        except BackendFailure as failure:
            return Proposal((), lost=f"no reply: {failure}")

    def recall(self, budget: int) -> list[Recollection]:
        """What the memories contribute, in the scaffold's order; a section longer than the budget is left out."""
        sections: list[Recollection] = []
        for participant in self._with("recall"):
            found = participant.call("recall", budget=budget)
            with border(participant.who, "recall"):
                section, length = products.recollection(found)
            if section is None:
                continue
            if length <= budget:
                sections.append(section)
            elif participant.who not in self._noted:
                self._noted.add(participant.who)
                self._note(
                    f"{participant.who}: recall gave {length} characters for a budget of {budget}; "
                    "such sections are left out of the prompt."
                )
        return sections

    def remember(self, trial: Trial, proposal: Proposal | None) -> None:
        """See `RunHooks.remember`."""
        for participant in self._with("remember"):
            participant.call("remember", trial=trial, proposal=proposal)

    def export(self, candidate: Candidate) -> Mapping[str, str]:
        """See `RunHooks.export`."""
        return self._optional("export", products.files, candidate=dict(candidate))

    def close(self) -> None:
        """See `RunHooks.close`; what goes wrong here is noted, for the run is over and the others are closed too."""
        for participant in self._with("close"):
            try:
                participant.call("close")
            except BsaError as error:
                self._note(str(error))


def _participant(plugin: object, kind: Part, who: str) -> Participant:
    """What a factory made, after a look at its methods."""
    with border(who, "its factory"):
        if plugin is None:
            raise Unfit("returned None", "a factory returns the object whose methods are the hooks.")
        methods, faults = hook_methods(plugin, RunHooks)
    main = _MAIN_HOOK[kind]
    if not faults and main not in methods:
        faults = {main: f'it does not implement "{main}", which is what a {kind} is for'}
    if faults:
        said = "; ".join(faults.values())
        raise BsaError(f"{who}: {said}{'' if said.endswith('?') else '.'}", "docs/plugins.md lists the hooks of a run.")
    return Participant(who, methods)
