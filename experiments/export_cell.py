"""``bsa export``: the cell that a run found, as a file for other programs."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..core.printable import rounded
from ..core.rms import rms
from ..core.target import CellChange
from ..core.task import CellModel, Experiment
from .tasks.parameter_source import read_finished

FILES = {"bpx": "best_parameters_bpx.json", "parameter-values": "best_parameter_values.json"}
"""What can be written, and the file's name in the run's folder."""

TOLERANCE_MV = 1.0
"""Largest difference between the cell and its BPX file that needs no mention: tables are read along straight lines."""


def exported(folder: Path, to: str) -> tuple[str, tuple[str, ...]]:
    """The best candidate of a run as the text of a file.

    ``to`` is ``bpx``, the Battery Parameter eXchange standard, or ``parameter-values``, what
    ``pybamm.ParameterValues.from_json`` reads. Gives the text, and remarks: what BPX cannot say of this cell, and how
    far the file's cell is from the run's on the first record. Raises `BsaError` if the folder holds no run of a PyBaMM
    cell, or the cell is no BPX cell.
    """
    from ..plugins.pybamm.cells.nameplate import labelled, widened_cut_offs
    from ..plugins.pybamm.cells.parameter_files import as_json, parsed
    from ..plugins.pybamm.cells.state_of_charge import changed_values
    from ..plugins.pybamm.export.bpx_export import to_bpx

    run = read_finished(folder)
    cell, experiment, change = run.task.cell, run.task.experiments[0], run.task.space.change(run.best.candidate)
    if to == "parameter-values":
        left_out = [f"A parameter set holds no effect; the fit had {', '.join(cell.effects)}."] * bool(cell.effects)
        return as_json(labelled(changed_values(cell, change), cell)), tuple(left_out)
    found = to_bpx(cell, change, experiment, run.task.name)
    read_back = replace(cell, parameter_set=parsed(FILES["bpx"], found.text), overrides=widened_cut_offs(cell))
    of_records = CellChange(
        initial_soc=change.initial_soc, initial_voltage=change.initial_voltage, current_offset=change.current_offset
    )
    difference = difference_on(experiment, (cell, change), (read_back, of_records))
    if difference is None:
        return found.text, (*found.left_out, "The file's cell could not be simulated on the first record.")
    return found.text, (*found.left_out, difference.words)


@dataclass(frozen=True)
class Difference:
    """How far the voltages of two cells are apart on one record."""

    # largest_mv, rms_mv: The largest difference and the root mean square over time, mV.
    largest_mv: float
    rms_mv: float
    # at_s, duration_s: When it is largest, and how long the record lasts, s.
    at_s: float
    duration_s: float

    @property
    def words(self) -> str:
        """Of a file's cell beside the run's own; where in the record they differ most, if they differ clearly."""
        largest = rounded(self.largest_mv, 2)
        words = f"Read back and simulated on the first record, the file is within {largest} mV of the run's"
        if self.largest_mv <= TOLERANCE_MV:
            return f"{words} own cell."
        return (
            f"{words} own cell, farthest off at {self.at_s:,.0f} s of {self.duration_s:,.0f} s "
            f"({rounded(self.rms_mv, 2)} mV rms): more than tables explain."
        )


def difference_on(
    experiment: Experiment, ours: tuple[CellModel, CellChange], theirs: tuple[CellModel, CellChange]
) -> Difference | None:
    """The difference of two changed cells' voltages on a record; None where one cannot be simulated.

    Under a protocol both pass the current that the first one passes: its steps end a little earlier in the one cell
    than in the other, and voltages behind them, compared at equal times, would differ by all that a step changes.
    """
    from ..plugins.pybamm.solving.experiment_kinds import solve_reference

    if experiment.protocol is not None and not experiment.long:
        passed = solve_reference(ours[0], experiment, ours[1]).trajectory
        if passed is None:
            return None
        experiment = replace(experiment, target=passed, protocol=None)
    curves = [solve_reference(cell, experiment, change).trajectory for cell, change in (ours, theirs)]
    if curves[0] is None or curves[1] is None:
        return None
    time = np.linspace(0.0, min(curve.time[-1] for curve in curves if curve), 1000)
    first, second = (np.interp(time, curve.time, curve.voltage) for curve in curves if curve)
    off = 1e3 * np.abs(first - second)
    worst = int(np.argmax(off))
    return Difference(float(off[worst]), rms(off), float(time[worst]), float(time[-1]))
