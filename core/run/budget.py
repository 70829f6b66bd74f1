"""How long a search may go on, where a run that was taken up again was allowed more."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from .recording import is_outcome
from .run_config import RunConfig

BUDGET = "budget"
"""Event of the journal: from its proposal on a run may take another number of simulations, rounds and idle rounds."""

RAISED = ("simulations", "rounds", "patience")
"""What of a configuration a run that is taken up again may be given more of."""


class SimulationBudget:
    """Simulations at most, by the number of proposals that were made before.

    What a proposer asks for depends on what is left to it. A round that was begun with another budget is therefore
    asked for with that one again, so that a resumed run asks for the simulations that its journal holds.
    """

    def __init__(self, config: RunConfig, events: Sequence[Mapping[str, Any]]) -> None:
        first = events[0].get("config", {}) if events else {}
        self._from = {0: int(first.get("simulations", config.simulations))}
        self._from |= {event["proposals"]: event["simulations"] for event in events if event["event"] == BUDGET}

    def after(self, proposals: int) -> int:
        """The budget of what follows so many proposals."""
        return self._from[max(place for place in self._from if place <= proposals)]

    def grows_after(self, proposals: int) -> bool:
        """Whether more is allowed from there on than the proposal before could know."""
        return proposals > 0 and self.after(proposals) > self.after(proposals - 1)


def begun_rounds(events: Iterable[Mapping[str, Any]]) -> int:
    """How many proposals were made, or begun: one for which the language model has given an answer is."""
    made, begun = 0, False
    for event in events:
        if event["event"] == "proposal":
            made, begun = made + 1, False
        elif is_outcome(event):
            begun = True
    return made + begun


def simulated(events: Iterable[Mapping[str, Any]]) -> int:
    """How many simulations were made, up to the last one: of those side by side a later one may have ended first."""
    return max((event["index"] + 1 for event in events if event["event"] == "trial"), default=0)


def since_budget(events: Sequence[Mapping[str, Any]]) -> Sequence[Mapping[str, Any]]:
    """The events since the budget was last changed; all where it never was."""
    last = max((place for place, event in enumerate(events) if event["event"] == BUDGET), default=-1)
    return events[last + 1 :]


def with_budget(config: Mapping[str, Any], events: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """A run's configuration as it began, with the budget that it was given last."""
    given = dict(config)
    for event in events:
        if event["event"] == BUDGET:
            given |= {key: event[key] for key in RAISED if event.get(key) is not None}
    return given
