"""A record that is calibrated by its measured current: simulated at its own samples."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ....core.inference.observations import after_jumps
from ....core.parameters import Candidate
from ....core.printable import counted, rounded
from ....core.simulation import ExperimentRun, SimulationFailure
from ....core.target import CellChange, Target, change_of
from ....core.task import CellModel, Experiment
from ....core.trajectory import Trajectory
from ..modelling.compiled_cell import start_of
from ..modelling.drive import JUMP_S
from ..modelling.resolution import SEARCH, Resolution
from .driven_cell import DrivenCell, Pause

_CLEARLY_MORE = 1.1
"""Charge of a record, in that until the simulated cell reached its limit, from which the lack of charge is told: cells
of one type differ by some percent."""


class DrivenExperiment:
    """An experiment that is driven by its measured current, ready to be simulated; see `CompiledExperiment`."""

    def __init__(
        self,
        cell: CellModel,
        experiment: Experiment,
        targets: Mapping[str, Target],
        resolution: Resolution = SEARCH,
        baked: CellChange | None = None,
    ) -> None:
        self._name, self._record = experiment.name, experiment.target
        self._targets = dict(targets)
        self._known = baked or CellChange()
        self._times = after_jumps(self._record)
        self._driven = DrivenCell(
            cell, (), self._record, targets, start_of(experiment), resolution.graded(), baked, any_start=False
        )

    def solve(self, candidate: Candidate, on_step: Callable[[str, int], None] | None = None) -> ExperimentRun:
        """Simulate one candidate at the samples and in the steps of the record.

        A candidate whose cell runs empty or full goes on without current until the measured one has fallen, or the step
        ends, and says so (`ExperimentRun.limits`). One that the integrator gives up has the samples that it reached.
        """
        searched = change_of(self._targets, candidate)
        offset = {**self._known.current_offset, **searched.current_offset}.get(self._name, 0.0)
        response = self._driven.follow(candidate, self._times, offset=offset)
        begin = float(self._record.time[0])
        words = _in_words(response.pauses, self._record)
        at_limit = tuple(
            (pause.start - begin, min(pause.end - begin, self._record.duration)) for pause in response.pauses
        )
        whole = (
            Trajectory(
                self._record.time - self._record.time[0],
                current=self._driven.current(self._times, response.pauses),
                voltage=response.voltage,
                temperature=response.temperature if self._driven.heats else None,
                steps=self._record.steps,
            )
            if np.all(np.isfinite(response.voltage))
            else None
        )
        if not response.cause:
            return ExperimentRun(whole, limits=words, at_limit=at_limit)
        count = int(np.searchsorted(self._times, response.reached + JUMP_S, side="right"))
        trajectory, failure = _until(whole, count, response.cause, response.reached - begin)
        return ExperimentRun(trajectory, failure, words, at_limit)


def _until(
    whole: Trajectory | None, count: int, cause: str, reached_s: float
) -> tuple[Trajectory | None, SimulationFailure]:
    """The first samples of a simulation that failed, and its failure."""
    # A single sample of a step says nothing of it.
    steps = [] if whole is None else [step for step in whole.steps if min(step.stop, step.start + 2) <= count]
    if whole is None or not steps:
        return None, SimulationFailure(cause)
    cut = replace(steps[-1], stop=min(steps[-1].stop, count))
    reached = whole.slice(0, cut.stop)
    trajectory = Trajectory(reached.time, steps=(*steps[:-1], cut), signals=reached.signals)
    failure = SimulationFailure(cause, cut.label or str(cut.kind), cut.cycle, reached_s, unfinished=cut != steps[-1])
    return trajectory, failure


def _in_words(pauses: Sequence[Pause], record: Trajectory) -> tuple[str, ...]:
    """``"the simulated cell was empty at 3,120 s of 3,600 s"``, once for empty and once for full.

    Where the record passes clearly more charge than until then: ``", after 4.6 A.h; the record draws 12.5 A.h, 2.7
    times as much"``. Elsewhere, if the step ended before the record did: ``", 12 s before the step ended"``.
    """
    words = []
    for what, found in (
        ("empty", [pause for pause in pauses if pause.empty]),
        ("full", [pause for pause in pauses if not pause.empty]),
    ):
        if found:
            at = found[0].start - float(record.time[0])
            more = len({pause.step_end for pause in found}) - 1
            again = f", and {counted(more, 'time')} more" if more else ""
            lacking = _charge_lacking(found[0], record)
            early = "" if lacking else _before_the_end(found[0], record)
            words.append(
                f"the simulated cell was {what} at {at:,.0f} s of {record.duration:,.0f} s{early}{again}{lacking}"
            )
    return tuple(words)


def _before_the_end(pause: Pause, record: Trajectory) -> str:
    """How long before the end of its step a cell reached its limit; empty where the record ends with that step."""
    if pause.step_end >= float(record.time[-1]) - JUMP_S:
        return ""
    return f", {pause.step_end - pause.start:,.0f} s before the step ended"


def _charge_lacking(pause: Pause, record: Trajectory) -> str:
    """How much more charge a record passes than the cell did until its limit; empty if it is a tenth or less."""
    passed = record.discharge_capacity if pause.empty else -record.discharge_capacity
    until, largest = float(np.interp(pause.start, record.time, passed)), float(passed.max())
    if largest < _CLEARLY_MORE * until:
        return ""
    times = f", {largest / until:.2g} times as much" if until > 0 else ""
    flow = "draws" if pause.empty else "charges"
    return f", after {rounded(until, 3)} A.h; the record {flow} {rounded(largest, 3)} A.h{times}"
