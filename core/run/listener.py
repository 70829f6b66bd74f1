"""Who follows a run while it goes on, for progress on a screen and times."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..messages import Usage
    from ..proposal import Proposal
    from ..trial import Phase, Trial


class Listener:
    """Is told how far a run is; does nothing with what a class derived from it passes over."""

    def proposed(self, proposal: Proposal, phase: Phase, number: int) -> None:
        """A proposal was made."""

    def asked(self, usage: Usage) -> None:
        """The language model is asked, and its answer waited for; ``usage`` is what it has cost so far."""

    def tried(self, trial: Trial, best: Trial, usage: Usage) -> None:
        """A simulation finished; ``best`` has the lowest objective so far."""

    def counted(self, purpose: str, done: int, total: int) -> None:
        """So many of the simulations beside the search that serve a purpose are done."""

    def cycled(self, cycle: int, cycles: int) -> None:
        """A simulation of a whole life has come to this cycle; of several side by side, the one that is farthest."""

    def noted(self, text: str) -> None:
        """Something worth saying happened."""


SILENT = Listener()
"""The listener of a run that nobody follows."""
