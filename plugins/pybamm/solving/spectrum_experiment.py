"""An impedance spectrum as an experiment: the cell at rest, asked at the frequencies of the measured one."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ....core.cell import FREQUENCY
from ....core.comparison.spectrum_record import parts_of
from ....core.parameters import Candidate
from ....core.simulation import ExperimentRun, SimulationFailure
from ....core.target import CellChange, Target
from ....core.task import CellModel, Experiment
from ..cells.parameter_sets import pybamm
from ..modelling.compiled_cell import SOLVER_ERRORS, CompiledCell, first_line, start_of
from ..modelling.resolution import SEARCH, Resolution

DOUBLE_LAYERS = {"surface form": "differential"}
"""Model option with the capacities of the double layers, without which a cell has no arc."""


class SpectrumExperiment:
    """A spectrum, ready to be simulated for many candidates without a rebuild; see `CompiledExperiment`.

    It is that of the cell at rest at the experiment's state of charge, or at that at which the candidate's own cell
    shows the experiment's voltage. The double layers are in this model alone: they are charged within milliseconds,
    which a record over time does not resolve and its integrator would have to.
    """

    def __init__(
        self,
        cell: CellModel,
        experiment: Experiment,
        targets: Mapping[str, Target],
        resolution: Resolution = SEARCH,
        baked: CellChange | None = None,
    ) -> None:
        self._record = experiment.target
        charged = replace(cell, options={**cell.options, **DOUBLE_LAYERS})
        self._cell = CompiledCell(charged, targets, start_of(experiment), resolution.graded(), baked)
        self._simulation: Any = self._cell.impedance()

    def solve(self, candidate: Candidate, on_step: Callable[[str, int], None] | None = None) -> ExperimentRun:
        """Compute the spectrum of one candidate; see `CompiledExperiment.solve`."""
        if on_step is not None:
            on_step(str(self._record.steps[0].kind), self._record.steps[0].cycle)
        try:
            inputs = self._cell.inputs(candidate)
            found = self._simulation.solve(self._record.values(FREQUENCY.name), inputs=inputs)
        except (*SOLVER_ERRORS, pybamm.ModelError) as error:
            return ExperimentRun(None, SimulationFailure(first_line(error)))
        impedance = np.asarray(found["Impedance [Ohm]"], dtype=np.complex128)
        if not np.all(np.isfinite(impedance)):
            return ExperimentRun(None, SimulationFailure("the impedance is no finite number"))
        return ExperimentRun(self._record.changed(**parts_of(impedance)))
