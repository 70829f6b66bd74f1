"""Which way an experiment is simulated: by its protocol, as a life, by its measured current, or as a spectrum."""

from collections.abc import Callable, Mapping

from ....core.simulation import ExperimentRun
from ....core.target import CellChange, Target
from ....core.task import CellModel, Experiment
from ..modelling.resolution import DRIVEN_LOW_FIDELITY, LOW_FIDELITY, REFERENCE, SEARCH, Resolution
from .compiled import CompiledExperiment
from .driven_experiment import DrivenExperiment
from .long_experiment import LongExperiment
from .spectrum_experiment import SpectrumExperiment

Simulated = CompiledExperiment | DrivenExperiment | LongExperiment | SpectrumExperiment


def compiled(
    cell: CellModel, experiment: Experiment, targets: Mapping[str, Target], resolution: Resolution = SEARCH
) -> Simulated:
    """An experiment that can be solved for many candidates, as in a search or by the low-fidelity model of a DFN."""
    kind = _kind(experiment)
    if resolution == LOW_FIDELITY and kind is DrivenExperiment:
        resolution = DRIVEN_LOW_FIDELITY
    return kind(cell, experiment, targets, resolution)


def solve_reference(
    cell: CellModel,
    experiment: Experiment,
    change: CellChange,
    resolution: Resolution = REFERENCE,
    on_step: Callable[[str, int], None] | None = None,
) -> ExperimentRun:
    """Simulate a changed cell at tight tolerance, built for it alone, all cycles; a protocol on PyBaMM's mesh."""
    if experiment.long:
        return LongExperiment(cell, experiment, {}, resolution, baked=change, leave_out=False).solve({}, on_step)
    return _kind(experiment)(cell, experiment, {}, resolution, baked=change).solve({}, on_step)


def _kind(experiment: Experiment) -> type[Simulated]:
    if experiment.is_spectrum:
        return SpectrumExperiment
    if experiment.protocol is None:
        return DrivenExperiment
    return LongExperiment if experiment.long else CompiledExperiment
