"""What changes over a life: residuals without what its fitted cycles have in common, which is the cell's own misfit."""

import numpy as np
from numpy.typing import NDArray

from ..comparison.residuals import noise_of_residuals, rows_of
from ..normal import robust_deviation
from ..rms import rms
from ..task import Task
from ..trajectory import FloatArray, StepKind
from .cycle_table import CycleTable
from .residuals import CAPACITY_TOLERANCE, RESISTANCE_TOLERANCE, compared_cycles


class Changes:
    """Residuals of a life without what its fitted cycles have in common, in standard deviations.

    A point of a curve is compared with the same point of the other cycles whose curves are kept, a capacity with the
    other capacities. Rests are left out: after a discharge to its cut-off a cell relaxes by as much as its last minute
    drove it, which says more of that minute than of ageing.

    Parameters
    ----------
    task : Task
        One life, all cycles of which are compared.
    fit_cycles : int
        The last cycle that is fitted; the later ones are held out.
    new : ndarray of shape (m,), optional
        Residuals of the cell that was fitted to the first cycle. Where that is off, a model tells a change no better:
        in each step of a cycle the misfit counts as noise.

    Attributes
    ----------
    fitted, held : ndarray of bool, shape (m,)
        Which of the residuals that are compared are of fitted cycles, and which of later ones.
    steps : ndarray of int, shape (m,)
        Which step of which cycle each is of.
    taken : ndarray of shape (n, common)
        What the means that are taken off have removed from the noise of fitted residuals (`inference.adequacy.judge`).
    """

    def __init__(self, task: Task, fit_cycles: int, new: FloatArray | None = None) -> None:
        (experiment,) = task.experiments
        table = experiment.target.cycle_table
        assert table is not None
        rows = rows_of(task)
        lines = _lines(table)
        curves = len(rows.record) - len(lines)
        cycles = np.array([step.cycle for step in experiment.target.steps])[rows.step]
        cycles[curves:] = [cycle for _, cycle, _ in lines]
        rests = [step.kind is StepKind.REST for step in experiment.target.steps]
        compared = np.array([*(not rests[step] for step in rows.step[:curves]), *([True] * len(lines))])
        self.fitted, self.held = compared & (cycles <= fit_cycles), compared & (cycles > fit_cycles)
        self.steps = np.where(np.arange(len(cycles)) < curves, rows.step, rows.step.max() + 1)
        begins = {step.cycle: place for place, step in reversed(list(enumerate(experiment.target.steps)))}
        points, number = [], 0
        for place in range(curves):
            same = place > 0 and rows.step[place] == rows.step[place - 1]
            number = number + 1 if same else 0
            points.append(f"{rows.step[place] - begins[int(cycles[place])]} {number}")
        points += [name for name, _, _ in lines]
        self._points = np.unique(points, return_inverse=True)[1]
        means = np.unique(self._points[self.fitted])
        of_mean = self._points[self.fitted][:, None] == means
        self.taken = of_mean / np.sqrt(np.sum(of_mean, axis=0))
        # A duration has no scale of its own: it weighs as the curves do.
        scale = np.where(rows.scale > 0, rows.scale, np.max(rows.scale[:curves], initial=0.0))
        self._sigma = np.hypot(scale, noise_of_residuals(task))
        self._sigma[curves:] = [scatter for _, _, scatter in lines]
        if new is not None:
            signals = [f"{points[place].split()[0]} {rows.signal[place]}" for place in range(curves)]
            self._sigma = np.hypot(self._sigma, _left(new, np.array([*signals, *points[curves:]]), cycles))

    @property
    def common(self) -> int:
        """How many means of fitted residuals are taken off: degrees of freedom that these have lost."""
        return int(self.taken.shape[1])

    def __call__(self, residual: FloatArray) -> FloatArray:
        """The changes in a task's residuals, in standard deviations, shape (m,)."""
        known = self._points[self.fitted]
        counts = np.bincount(known, minlength=self._points.max() + 1)
        sums = np.bincount(known, residual[self.fitted], minlength=len(counts))
        common = sums / np.maximum(counts, 1)
        # A point that no fitted cycle has says nothing of what changes.
        there = counts[self._points] > 0
        return np.asarray(np.where(there, residual - common[self._points], 0.0) / self._sigma)


def _lines(table: CycleTable) -> list[tuple[str, int, float]]:
    """Of each residual of a cycle table what it is, its cycle, and the scatter of its like, in tolerances."""
    picks = compared_cycles(table)
    known = picks[np.isfinite(table.resistance_ohm[picks])]
    found = []
    for name, values, places, tolerance in (
        ("capacity", table.capacity_ah, picks, CAPACITY_TOLERANCE),
        ("resistance", table.resistance_ohm, known, RESISTANCE_TOLERANCE),
    ):
        scatter = max(1.0, _scatter(values) / tolerance)
        found += [(name, int(table.cycle[place]), scatter) for place in places]
    return found


def _left(new: FloatArray, kinds: NDArray[np.str_], cycles: NDArray[np.intp]) -> FloatArray:
    """Root mean square of what is left of each kind of residual in the first cycle that has it."""
    found = np.zeros(len(new))
    for kind in np.unique(kinds):
        same = kinds == kind
        first = same & (cycles == np.min(cycles[same]))
        found[same] = np.sqrt(np.mean(new[first] ** 2))
    return found


def _scatter(values: FloatArray) -> float:
    """How much neighbours scatter about a smooth curve, as a share of their mean."""
    known = values[np.isfinite(values)]
    if len(known) < 3:
        return 0.0
    return float(robust_deviation(np.diff(known, 2)) / np.sqrt(6.0) / np.mean(known))


def of_cycles(values: FloatArray, chosen: NDArray[np.bool_]) -> float:
    """Root mean square of the residuals of some cycles; 0 for none."""
    return rms(values[chosen]) if np.any(chosen) else 0.0
