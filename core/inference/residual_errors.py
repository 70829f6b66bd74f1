"""How far the residuals of a search are off: by noise, clock and charge of the records, and by the mesh."""

from dataclasses import dataclass

import numpy as np

from ..comparison.knees import knees_of_residuals
from ..comparison.residuals import noise_of_residuals, residuals, rows_of
from ..rms import rms
from ..task import Task
from ..trajectory import FloatArray
from ..trial import Trial
from .simulating import Simulating, Spent

NOISE_FLOOR = 0.3
"""Deviation assumed at least of each residual, in tolerances as the fit weighs them.

Of a point of average weight it is 0.3 mV, or about 0.3 % of a current, as a good cycler has. A target that was
simulated has no noise, and its fit would seem to fix everything. In a record of steps of unequal length it is what the
model lacks: as in the fit, a short step says no more than its share of the time.
"""

_FLOOR_OF_DURATIONS = 1.0
"""The same of the duration of a step, whose noise no record tells: 0.1 %, the accuracy of a cycler's current."""

_OF_THE_MESH = 0.5
"""Share of the change of a residual by a finer mesh that counts as uncertain: at the end of a step the change is twice
as large for one candidate as for another."""

_NO_APPROXIMATION = 3.0
"""Root mean square, in tolerances, by which search and reference may differ: beyond it, and beyond the misfit, one of
them is no approximation of the other, and the search's residuals stand."""


@dataclass(frozen=True, eq=False)
class Errors:
    """How far residuals are off, whatever the candidate, in tolerances; arrays of shape (m,)."""

    deviation: FloatArray  # Standard deviation of each, independent of the others.
    shift: FloatArray  # What is known of the mesh of the search: to be added to its residuals.
    doubt: FloatArray  # Standard deviation of what is not, all of it of one sign.

    def whitened(self, residual: FloatArray) -> FloatArray:
        """Residuals of the search whose errors are independent and of deviation one."""
        scaled, doubt = (residual + self.shift) / self.deviation, self.doubt / self.deviation
        power = float(doubt @ doubt)
        if power == 0.0:
            return np.asarray(scaled)
        return np.asarray(scaled - (1.0 - 1.0 / np.sqrt(1.0 + power)) * doubt * float(doubt @ scaled) / power)


def errors_of(task: Task, best: Trial, plugins: Simulating, spent: Spent) -> Errors:
    """How far the search's residuals are off: by noise, clock and charge of the record, and by the mesh.

    The error of the mesh hardly depends on the candidate: what one simulation on twice the points shows is added to the
    residuals of all. The error falls with the square of the spacing, so that a third as much is left.
    """
    assert best.residuals is not None
    floor = np.where(rows_of(task).signal == "", _FLOOR_OF_DURATIONS, NOISE_FLOOR)
    deviation = np.hypot(np.hypot(noise_of_residuals(task), floor), knees_of_residuals(task))
    deviation *= misfit_by_kind(task, best.residuals / deviation)
    (outcome,) = spent.counted(plugins.simulate([best.candidate], True), 1)
    reference = residuals(task, outcome)
    nothing = np.zeros(len(deviation))
    if reference is None or rms(reference - best.residuals) > max(best.misfit, _NO_APPROXIMATION):
        return Errors(deviation, nothing, nothing)
    # A life takes minutes, and its tolerances are wider than what a mesh does.
    finer = None if task.long else plugins.simulate_finer(best.candidate)
    found = None if finer is None else residuals(task, finer)
    shift = (reference if found is None else found) - best.residuals
    doubt = nothing if found is None else (found - reference) / 3.0
    return Errors(np.hypot(deviation, _OF_THE_MESH * shift), shift, doubt)


def misfit_by_kind(task: Task, residual: FloatArray) -> FloatArray:
    """Factors by which the residuals of spectra, and those over time, exceed their deviation; ones for a single kind.

    A model that is tens of millivolts off the open-circuit curve may be right about the impedance within a few percent:
    the misfit of one kind tells nothing of the other.
    """
    of_spectra = np.array([experiment.is_spectrum for experiment in task.experiments])[rows_of(task).record]
    misfit = np.ones(len(residual))
    if of_spectra.all() or not of_spectra.any():
        return misfit
    for kind in (of_spectra, ~of_spectra):
        misfit[kind] = max(rms(residual[kind]), 1.0)
    return misfit
