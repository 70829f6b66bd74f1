"""Which way an experiment is simulated: whole, or as a long record."""

from __future__ import annotations

from collections.abc import Mapping

from ...core.simulation import ExperimentRun
from ...core.target import CellChange, Target
from ...core.task import CellModel, Experiment
from .compiled import REFERENCE, Accuracy, CompiledExperiment
from .long_experiment import LongExperiment


def compiled(
    cell: CellModel, experiment: Experiment, targets: Mapping[str, Target]
) -> CompiledExperiment | LongExperiment:
    """An experiment, ready to be solved for many candidates with the search's accuracy."""
    return (LongExperiment if experiment.long else CompiledExperiment)(cell, experiment, targets)


def solve_reference(
    cell: CellModel, experiment: Experiment, change: CellChange, accuracy: Accuracy = REFERENCE
) -> ExperimentRun:
    """Simulate a changed cell on PyBaMM's standard mesh at tight tolerance, built for it alone, every cycle of it."""
    if experiment.long:
        return LongExperiment(cell, experiment, {}, accuracy, baked=change, leave_out=False).solve({})
    return CompiledExperiment(cell, experiment, {}, accuracy, baked=change).solve({})
