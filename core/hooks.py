"""The hooks: what a plugin may offer, and what takes part in a run.

Two levels. A *catalogue* plugin (found through the entry-point group ``bsa``) yields `Entry` objects:
what exists. A *run* plugin is what an entry's factory returns: it implements one or more of the run
hooks and lives as long as the run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pluggy
from pydantic import BaseModel

from .domain import Domain
from .feedback import Feedback
from .messages import Backend
from .parameters import Candidate
from .proposal import Proposal
from .simulation import Outcome
from .task import Experiment, Protocol, Task
from .task_reduction import TaskReduction
from .trajectory import FloatArray
from .trial import Trial

if TYPE_CHECKING:
    from .metrics import Metrics

PROJECT = "bsa"
API_VERSION = 1

hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


class NoOptions(BaseModel, extra="forbid"):
    """The configuration of a plugin that has nothing to configure."""


@dataclass(frozen=True)
class Entry:
    """One thing that exists: a simulator, a memory, a backend, ...

    Attributes
    ----------
    name : str
        Unique among its kind; lower case, words joined by hyphens.
    factory : callable
        Makes the plugin from its configuration (an instance of ``config_type``) and, for run plugins,
        the `RunContext`. Imports its libraries lazily, so that listing is fast.
    summary : str
        One line for ``bsa list``.
    config_type : type of pydantic.BaseModel
        What can be configured, with a sentence on every field.
    api : int
        Version of this interface that the plugin was written for: the number, by name, so that a plugin that was
        not changed along with the interface can be told.
    domain : Domain, optional
        Of a simulator: the signals and the wording of what it simulates, for tasks that name it.
    asks_model : bool
        Of a proposer: whether it asks the language model about once a round, as the estimate of a grid counts.
    """

    name: str
    factory: Callable[..., Any]
    summary: str
    config_type: type[BaseModel] = NoOptions
    api: int = field(kw_only=True)
    domain: Domain | None = field(default=None, kw_only=True)
    asks_model: bool = field(default=False, kw_only=True)


@dataclass(frozen=True)
class Recollection:
    """What one memory contributes to a prompt.

    Attributes
    ----------
    title : str
        Heading of the section, ``"Memory: trials so far"``; see `prompt_sections` for those that have a form.
    content : mapping
        JSON-ready, compact and rounded.
    priority : int
        When the context is too small, the sections of lowest priority are dropped first.
    """

    title: str
    content: Mapping[str, Any]
    priority: int = 0


@dataclass(frozen=True)
class RunContext:
    """What a plugin may know when it is made.

    Attributes
    ----------
    task : Task
        What is to be matched.
    seed : int
        Seed of the run; derive your own generator from it and from the round.
    folder : Path
        The run's folder, for files that belong to the run (overlay images).
    backend : Backend or None
        The language model, for plugins that ask one.
    workers : int
        How many simulations run side by side when a proposal holds several candidates.
    cycled : callable
        ``cycled(cycle, cycles)`` may be called while a long simulation goes on: it has come to this cycle of so many.
        It is shown to the user, and of no other consequence.
    """

    task: Task
    seed: int
    folder: Path
    backend: Backend | None = None
    workers: int = 1
    cycled: Callable[[int, int], None] = field(default=lambda cycle, cycles: None)


LowFidelityResiduals = Callable[[Sequence[Candidate]], Sequence[FloatArray | None]]
"""See `ProposeContext.low_fidelity`."""


@dataclass(frozen=True)
class ProposeContext:
    """What a proposer may know when it is asked.

    Attributes
    ----------
    task : Task
        What is to be matched.
    round : int
        The round of this phase, from 1.
    trials : sequence of Trial
        Every trial so far, oldest first, warm-up included.
    best : Trial
        The trial with the lowest objective so far; the initial one if none succeeded.
    seed : int
        Seed for this round.
    simulations_left : int
        How many candidates may still be simulated.
    recall : callable
        ``recall(budget)`` returns the `Recollection` of every memory in the scaffold, ``budget``
        characters each at most.
    equilibrium : callable
        ``equilibrium(candidates)`` returns the outcomes of `RunHooks.equilibrium` in the order of the candidates, or
        None where the simulator has none. They are not counted as simulations.
    low_fidelity : callable or None
        ``low_fidelity(candidates)`` returns the residuals of `RunHooks.simulate_low_fidelity` in the order of the
        candidates, each of shape (m,), None for one that failed. They are not counted as simulations either, but
        journalled, and their time is told. None where the simulator has no such model.
    """

    task: Task
    round: int
    trials: Sequence[Trial]
    best: Trial
    seed: int
    simulations_left: int
    recall: Callable[[int], list[Recollection]] = field(default=lambda budget: [])
    equilibrium: Callable[[Sequence[Candidate]], Sequence[Outcome] | None] = field(default=lambda candidates: None)
    low_fidelity: LowFidelityResiduals | None = None


class CatalogueHooks:
    """What exists. Every hook is collected from all plugins."""

    @hookspec
    def bsa_simulators(self) -> Iterable[Entry]:
        """Simulators; the factory's product implements `RunHooks.simulate`."""

    @hookspec
    def bsa_feedback_builders(self) -> Iterable[Entry]:
        """Feedback builders; the product implements `RunHooks.build_feedback`."""

    @hookspec
    def bsa_memories(self) -> Iterable[Entry]:
        """Memories and priors; the product implements `RunHooks.recall`, most also `RunHooks.remember`."""

    @hookspec
    def bsa_proposers(self) -> Iterable[Entry]:
        """Proposers; the product implements `RunHooks.propose`."""

    @hookspec
    def bsa_warm_ups(self) -> Iterable[Entry]:
        """Warm-up strategies; the product implements `RunHooks.warm_up`."""

    @hookspec
    def bsa_backends(self) -> Iterable[Entry]:
        """Language models; the product is a `Backend`."""

    @hookspec
    def bsa_routes(self) -> Iterable[Entry]:
        """Routes to language models, each asked by its name; the product is a `bsa.backends.route.Route`."""

    @hookspec
    def bsa_readers(self) -> Iterable[Entry]:
        """File readers; the product is a `Reader`."""

    @hookspec
    def bsa_tasks(self) -> Iterable[Entry]:
        """Tasks that can be named without a file; the product is a `Task`."""

    @hookspec
    def bsa_effects(self) -> Iterable[Entry]:
        """Physical and measurement effects; the product is an `Effect`."""


class RunHooks:
    """What takes part in a run."""

    @hookspec(firstresult=True)
    def simulate(self, candidates: Sequence[Candidate], exact: bool) -> Iterable[tuple[int, Outcome]]:
        """Simulate candidates of the task, side by side where the simulator can.

        Exactly one plugin of a run implements this.

        Parameters
        ----------
        candidates : sequence of Candidate
            Complete candidates inside the bounds.
        exact : bool
            Whether to use the reference discretisation and tolerances (for the final score) rather
            than the fast ones.

        Yields
        ------
        place : int
            Place of the candidate in ``candidates``, from 0.
        outcome : Outcome
            With one run for each experiment of the task. A failed simulation is an outcome, never an exception.

        Notes
        -----
        Every candidate is answered once, in any order. What is yielded is in the journal before the next candidate
        is asked for, so yield each outcome as soon as it is known: an interrupted run then loses none.
        """

    @hookspec(firstresult=True)
    def simulate_finer(self, candidate: Candidate) -> Outcome | None:
        """A candidate on a mesh of twice the points of the reference discretisation; see `simulate`.

        Optional: tells how far the discretisation stands from the equations. A simulator without one has no such error.
        """

    @hookspec(firstresult=True)
    def simulate_low_fidelity(self, candidates: Sequence[Candidate]) -> Iterable[tuple[int, Outcome]] | None:
        """Simulate candidates by a cheaper model: a coarse mesh, or a reduced-order model. Optional.

        A fit of this model, corrected by what `simulate` has shown, says where `simulate` is asked next. It is worth
        its while where it takes a small share of the time, and derivatives are off by some percent.

        Parameters
        ----------
        candidates : sequence of Candidate
            As for `simulate`; none where it is only asked whether there is such a model.

        Yields
        ------
        place, outcome
            As for `simulate`. None in place of an iterable where the task has no such model.
        """

    @hookspec(firstresult=True)
    def simulate_variant(
        self, candidates: Sequence[Candidate], experiments: tuple[Experiment, ...], exact: bool
    ) -> Iterable[tuple[int, Outcome]] | None:
        """Simulate candidates of the task's cell under other experiments than the task's.

        Optional: a simulator without it cannot reduce a task, say what to measure next or predict other records.

        Parameters
        ----------
        candidates : sequence of Candidate
            As for `simulate`.
        experiments : tuple of Experiment
            What to simulate instead; their targets may be empty.
        exact : bool
            As for `simulate`; an implementation that does not take it has one accuracy for both.

        Yields
        ------
        place, outcome
            As for `simulate`, with one run for each of these experiments.
        """

    @hookspec(firstresult=True)
    def reduce_task(self, reduction: TaskReduction) -> tuple[Experiment, ...] | None:
        """The task's experiments, reduced: what `simulate_variant` is then given. Optional.

        The same reduction must give the same object, so that what was compiled for it can be kept.
        """

    @hookspec(firstresult=True)
    def equilibrium(self, candidates: Sequence[Candidate]) -> Iterable[tuple[int, Outcome]] | None:
        """What candidates would show at the record's samples if they were at equilibrium all the time. Optional.

        A cell then shows the open-circuit voltage that belongs to the charge drawn so far. A fit asks for it hundreds
        of times between two simulations, so that it has to take milliseconds.

        Parameters
        ----------
        candidates : sequence of Candidate
            Complete candidates inside the bounds.

        Yields
        ------
        place, outcome
            As for `simulate`. None in place of an iterable where the samples follow from the simulation (under a
            protocol).
        """

    @hookspec(firstresult=True)
    def next_protocols(self) -> Mapping[str, Protocol] | None:
        """Protocols by name that a laboratory could run next on a fully charged cell. Optional."""

    @hookspec(firstresult=True)
    def build_feedback(self, outcome: Outcome, metrics: Metrics | None, index: int) -> Feedback | None:
        """Turn an outcome into what the proposer is told. Exactly one plugin implements this."""

    @hookspec(firstresult=True)
    def propose(self, context: ProposeContext) -> Proposal | None:
        """Say what to try next. Exactly one plugin implements this.

        On resume the proposer is asked the same questions again, and its earlier answers must come
        out the same: everything random must come from ``context.seed``.
        """

    @hookspec(firstresult=True)
    def weighs_priors(self) -> bool | None:
        """Whether the proposer weighs the priors of the search space against the residuals. Optional.

        What is said of the fitted parameters then weighs them too.
        """

    @hookspec(firstresult=True)
    def warm_up(self, context: ProposeContext) -> Proposal | None:
        """Say which perturbations to try before the search. At most one plugin implements this."""

    @hookspec
    def recall(self, budget: int) -> Recollection | None:
        """Contribute a section of at most ``budget`` characters to the prompt."""

    @hookspec
    def remember(self, trial: Trial, proposal: Proposal | None) -> None:
        """Take note of a finished trial and of the proposal it came from."""

    @hookspec(firstresult=True)
    def export(self, candidate: Candidate) -> Mapping[str, str] | None:
        """Write the calibrated cell as files that stand alone: contents by file name. Optional."""

    @hookspec
    def close(self) -> None:
        """Release processes and files; called once, when the run ends."""
