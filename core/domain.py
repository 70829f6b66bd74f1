"""What a simulator is about: its signals, and the words of its field in prompts, reports and on the terminal."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from .signals import Signal

Metric = Literal["misfit", "paper"]


@dataclass(frozen=True)
class Domain:
    """The wording of one field, supplied by a simulator (`Entry.domain`). Everything but the name is optional.

    Attributes
    ----------
    name : str
        What is modelled: ``"damped oscillator"``.
    expert : str
        The opening of the agent's instructions: who it is, which model it calibrates, and what is to match.
    signals : tuple of Signal
        The signals of its tasks, where a task names none itself.
    metric : {'misfit', 'paper'}
        What "best" means: the root mean square of the observed mismatches in their tolerances, or the paper's
        percentage errors of charge, current and voltage.
    brief_s : float
        Steps shorter than this say little of their own and count less, s.
    signals_told : bool
        Whether the agent is told the signals with their units and tolerances; needless where its field knows them.
    rules : tuple of mapping
        Rules of thumb for the priors: ``parameter`` (or a part of its name), ``raises``, ``lowers``, ``why``.
    drives : str
        What can be lowered while a task is reduced, ``"currents"``; empty if the field knows no reduction.
    gentler : str
        The sentence in which the agent is told how to reduce the task.
    start_of_next : str
        The state from which a suggested further record starts: ``"from a fully charged cell"``.
    accuracy : str
        What the simulator's reference accuracy is: ``"PyBaMM's number of mesh points and tight tolerances"``.
    search_accuracy : str
        How the search's simulations differ from that.
    sign_note : str
        A sentence on sign conventions for the reader of a figure.
    errors_note : str
        How the errors hang together.
    driven_note : str
        What follows for the errors where measured signals drive the simulation.
    export_note : str
        How to use the files that the simulator's ``export`` writes, as sentences; commands stand between grave
        accents.
    """

    name: str
    expert: str = ""
    signals: tuple[Signal, ...] = ()
    metric: Metric = "misfit"
    brief_s: float = 1.0
    signals_told: bool = True
    rules: tuple[Mapping[str, Any], ...] = ()
    drives: str = ""
    gentler: str = (
        "go to gentler values first (a failing or vanished step comes back), match what is left with large residuals "
        "flattened, then come back."
    )
    start_of_next: str = ""
    accuracy: str = "the simulator's reference accuracy"
    search_accuracy: str = "Errors during the search may differ slightly from the final scores above."
    sign_note: str = ""
    errors_note: str = ""
    driven_note: str = ""
    export_note: str = ""

    def __repr__(self) -> str:
        # It is the default of a field of tasks, so that its representation stands in their signature.
        return f"Domain({self.name!r})"

    @property
    def introduction(self) -> str:
        """The opening of the agent's instructions."""
        return self.expert or (
            f"You are an expert in models of the system at hand ({self.name}). You calibrate such a model so that its "
            "simulated record matches a measured one."
        )

    @property
    def too_brief_s(self) -> float:
        """Steps shorter than this say nothing of their own, s."""
        return self.brief_s / 3.0
