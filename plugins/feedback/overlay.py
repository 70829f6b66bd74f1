"""Structured feedback with a picture: simulated over measured, for models that see."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...core.comparison.alignment import StepPair
from ...core.feedback import Feedback
from ...core.files import replacing
from ...core.hooks import NoOptions, RunContext, hookimpl
from ...core.metrics import Metrics
from ...core.signals import Signal
from ...core.simulation import Outcome
from ...core.task import Task
from ...core.trajectory import SECONDS_PER_HOUR
from .structured import StructuredFeedback

FOLDER = "overlays"

_CURVES = (("tab:orange", "measured"), ("tab:blue", "simulated"))
_STEP_POINTS = 200

_HOURS_BEYOND_S = 600.0
"""A record longer than this is drawn over hours."""


class OverlayFeedback:
    """The structured package and one PNG a trial, written into the run's folder."""

    def __init__(self, options: NoOptions, context: RunContext) -> None:
        self._structured = StructuredFeedback(options, context)
        self._task = context.task
        self._folder = context.folder / FOLDER

    @hookimpl
    def build_feedback(self, outcome: Outcome, metrics: Metrics | None, index: int) -> Feedback:
        """See `RunHooks.build_feedback`."""
        content = self._structured.build_feedback(outcome, metrics, index).content
        path = self._folder / f"trial-{index:03d}.png"
        draw_overlay(self._task, outcome, path)
        return Feedback(content, (path,))


def draw_step(pair: StepPair, signals: Sequence[Signal], path: Path) -> None:
    """Draw a step's observed signals over the share of the step's own duration, as they are compared."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2, 2.3 * len(signals)), dpi=80, layout="constrained")
    rows = figure.subplots(len(signals), 1, sharex=True, squeeze=False)[:, 0]
    fractions = np.linspace(0.0, 1.0, _STEP_POINTS)
    for axes, signal in zip(rows, signals, strict=True):
        for values, (colour, label) in zip(pair.curves(signal, fractions), _CURVES, strict=True):
            axes.plot(100.0 * fractions, values, color=colour, label=label, linewidth=1.2)
        axes.set_ylabel(f"{signal.words} [{signal.unit}]")
    rows[0].set_title(pair.name, fontsize=9)
    rows[0].legend(fontsize=8)
    rows[-1].set_xlabel("share of the step's own duration [%]")
    with replacing(path) as file:
        figure.savefig(file, format="png")


def draw_overlay(task: Task, outcome: Outcome, path: Path) -> None:
    """Draw the signals over time, driven ones on top, one column a record, as the paper's prompt shows them."""
    from matplotlib.figure import Figure

    count, signals = len(task.experiments), (*task.driven, *task.observed)
    figure = Figure(figsize=(5.2 * min(count, 3), 2.3 * len(signals)), dpi=80, layout="constrained")
    axes = figure.subplots(len(signals), min(count, 3), sharex="col", squeeze=False)
    longest = max(experiment.target.duration for experiment in task.experiments)
    scale, unit = (SECONDS_PER_HOUR, "h") if longest > _HOURS_BEYOND_S else (1.0, "s")
    for column, (experiment, run) in enumerate(zip(task.experiments[:3], outcome.runs, strict=False)):
        for record, (colour, label) in zip((experiment.target, run.trajectory), _CURVES, strict=True):
            if record is None:
                continue
            time = (record.time - record.time[0]) / scale
            for row, signal in enumerate(signals):
                if signal.name not in record.signals:
                    continue
                axes[row, column].plot(time, record.values(signal.name), color=colour, label=label, linewidth=1.2)
        axes[0, column].set_title(experiment.name, fontsize=9)
        axes[-1, column].set_xlabel(f"time [{unit}]")
    for row, signal in enumerate(signals):
        axes[row, 0].set_ylabel(f"{signal.words} [{signal.unit}]")
    axes[0, 0].legend(fontsize=8)
    with replacing(path) as file:
        figure.savefig(file, format="png")
