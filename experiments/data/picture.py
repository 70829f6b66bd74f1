"""A record or a spectrum as a picture."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.constants import zero_Celsius

from ...core.files import replacing
from ...core.printable import rounded
from ...core.reading.summary import CycleRow, summary
from ...core.record import Record
from ...core.spectrum import ImpedanceSpectrum
from ...core.thinning import SAMPLES_OF_DRIVES

_SAMPLES_A_STEP = 400
_CYCLES = 4
"""With fewer cycles their capacities are no curve."""


def draw(found: Record | ImpedanceSpectrum, path: Path, listed: str = "") -> None:
    """Write a picture: signals over time and capacities by cycle, or a Nyquist plot.

    ``listed`` is what `bsa data` lists of the record, if not all of what is drawn.

    Its name ends in ``.png`` or ``.svg``. Raises `BsaError` if the file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6), layout="constrained")
    title = f"{found.name}\nall of the record; {listed}" if listed else found.name
    figure.suptitle(title.replace("$", r"\$"), fontsize=10)
    if isinstance(found, ImpedanceSpectrum):
        _nyquist(figure, found)
    else:
        _signals(figure, found)
    with replacing(path) as file:
        figure.savefig(file, format=path.suffix[1:].lower(), dpi=120)


def _nyquist(figure: Any, found: ImpedanceSpectrum) -> None:
    axes = figure.add_subplot()
    axes.plot(1e3 * found.impedance.real, -1e3 * found.impedance.imag, "o-", markersize=3)
    middle = 0.5e3 * float(found.impedance.real.min() + found.impedance.real.max())
    for decade in range(-4, 6):
        k = int(np.argmin(np.abs(np.log10(found.frequency) - decade)))
        if abs(np.log10(found.frequency[k]) - decade) < 0.2:
            place = 1e3 * found.impedance[k].real, -1e3 * found.impedance[k].imag
            # On the side of the middle, so that no label crosses the frame.
            side, text = (-1, "right") if place[0] > middle else (1, "left")
            label = f"{rounded(float(found.frequency[k]), 2)} Hz"
            axes.annotate(label, place, fontsize=8, ha=text, xytext=(4 * side, 4), textcoords="offset points")
    axes.set_xlabel("Re Z [mohm]")
    axes.set_ylabel("-Im Z [mohm]")
    axes.set_aspect("equal", "datalim")
    axes.grid(alpha=0.3)


def _signals(figure: Any, found: Record) -> None:
    most = max(2, min(_SAMPLES_A_STEP, 200_000 // max(1, len(found.trajectory.steps))))
    trajectory = found.trajectory.thinned(most, SAMPLES_OF_DRIVES)
    cycles = summary(found).cycles
    curves = [("Voltage [V]", trajectory.voltage), ("Current [A]\n(positive on charge)", -trajectory.current)]
    if trajectory.temperature is not None:
        curves.append(("Temperature [degC]", trajectory.temperature - zero_Celsius))
    rows = len(curves) + (len(cycles) >= _CYCLES)
    grid = figure.subplots(rows, 1, squeeze=False)[:, 0]
    hours = trajectory.time / 3600.0
    for axes, (label, values) in zip(grid, curves, strict=False):
        axes.plot(hours, values, linewidth=0.8)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.sharex(grid[0])
    grid[len(curves) - 1].set_xlabel("Time [h]")
    if len(cycles) >= _CYCLES:
        _capacities(grid[-1], cycles)


def _capacities(axes: Any, cycles: tuple[CycleRow, ...]) -> None:
    numbers = [row.cycle for row in cycles]
    axes.plot(numbers, [row.discharged_ah for row in cycles], ".", markersize=3, label="discharged")
    axes.plot(numbers, [row.charged_ah for row in cycles], ".", markersize=3, label="charged")
    axes.set_xlabel("Cycle")
    axes.set_ylabel("Charge [A.h]")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
