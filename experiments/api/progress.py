"""A bar that shows how far a calibration or a discovery is, in notebooks and in terminals."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from ...core.messages import Usage
from ...core.metrics import objective_of
from ...core.printable import shown
from ...core.proposal import Proposal
from ...core.run.listener import Listener
from ...core.task import Task
from ...core.trial import Phase, Trial


class Bar:
    """A bar of ``tqdm.auto``, a widget where the notebook has widgets; ``total`` is None where nobody knows it."""

    def __init__(self, total: int | None, unit: str, visible: bool) -> None:
        self._total, self._counted, self._visible = total, f" {unit}", visible

    @cached_property
    def _bar(self) -> Any:
        """The bar, drawn when it is first told something: what is refused before needs none."""
        if self._visible:
            from tqdm.auto import tqdm
        else:
            from tqdm.std import tqdm  # the widget would be made even if it is not shown
        return tqdm(total=self._total, unit=self._counted, disable=not self._visible, dynamic_ncols=True)

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *exception: object) -> None:
        if "_bar" in vars(self):
            self._bar.close()


class CalibrationBar(Bar, Listener):
    """The listener of a calibration; it shows no notes, which the journal and the report keep."""

    def __init__(self, task: Task, simulations: int, visible: bool) -> None:
        super().__init__(simulations, "simulations", visible)
        self._unit = objective_of(task).of_unit
        self._describe("first simulation")

    def proposed(self, proposal: Proposal, phase: Phase, number: int) -> None:
        """See `Listener.proposed`."""
        self._describe(f"{phase}, round {number}")

    def asked(self, usage: Usage) -> None:
        """See `Listener.asked`."""
        self._bar.set_description_str("waiting for the language model")

    def tried(self, trial: Trial, best: Trial, usage: Usage) -> None:
        """See `Listener.tried`."""
        self._bar.update(trial.index + 1 - self._bar.n)
        if best.ok:
            self._bar.set_postfix_str(f"{best.objective:.4g} {self._unit}")

    def counted(self, purpose: str, done: int, total: int) -> None:
        """See `Listener.counted`."""
        self._describe(f"{purpose}: {done} of {total}")

    def cycled(self, cycle: int, cycles: int) -> None:
        """See `Listener.cycled`."""
        self._bar.set_description_str(f"{self._stage}, cycle {cycle} of {cycles}")

    def _describe(self, stage: str) -> None:
        self._stage = stage
        self._bar.set_description_str(stage)


class DiscoveryBar(Bar):
    """The listener of a discovery."""

    def __init__(self, visible: bool) -> None:
        super().__init__(None, "steps", visible)

    def said(self, text: str) -> None:
        """Show what is being done."""
        self._bar.set_description_str(shown(text, 100))
        self._bar.update()
