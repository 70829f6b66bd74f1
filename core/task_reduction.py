"""A task made easier for a while: lower currents, or only its first cycles."""

from dataclasses import dataclass, replace

from .errors import BsaError
from .task import Experiment


@dataclass(frozen=True)
class TaskReduction:
    """How a task is reduced. A reduced simulation never counts as a fit of the task."""

    # Factor on every current, more than 0 and at most 1. There is no record at lower currents, so these simulations
    # only show whether the cell can be simulated, and how polarised it is.
    rate: float = 1.0
    cycles: int | None = None  # Only so many cycles, which are compared with the record's first ones; None for all.

    def __post_init__(self) -> None:
        if not 0.0 < self.rate <= 1.0:
            raise BsaError(
                f"0 < rate <= 1 must hold, but got rate={self.rate:g}.", "a task is reduced by lower currents."
            )
        if self.cycles is not None and self.cycles < 1:
            raise BsaError(f"cycles >= 1 must hold, but got cycles={self.cycles}.")

    @property
    def words(self) -> str:
        """``"at 50 % of the currents"``, ``"the first cycle alone"``."""
        parts = [f"at {100.0 * self.rate:.3g} % of the currents"] * (self.rate < 1.0)
        if self.cycles is not None:
            parts.append("the first cycle alone" if self.cycles == 1 else f"the first {self.cycles} cycles alone")
        return ", ".join(parts) or "as it is"


def shortened(experiment: Experiment, cycles: int | None) -> Experiment:
    """The experiment's first cycles, protocol and record, all of which are compared; whole where it has no more."""
    if cycles is None:
        return experiment
    target = experiment.target
    kept = [step for step in target.steps if step.cycle <= cycles]
    if kept and len(kept) < len(target.steps):
        target = target.slice(0, kept[-1].stop)
    if experiment.target.cycle_table is not None:
        target = replace(target, cycle_table=experiment.target.cycle_table.up_to(cycles))
    protocol = None if experiment.protocol is None else experiment.protocol[:cycles]
    detailed = tuple(cycle for cycle in experiment.detailed_cycles if cycle <= cycles)
    return replace(experiment, target=target, protocol=protocol, scored_cycle=None, detailed_cycles=detailed)
