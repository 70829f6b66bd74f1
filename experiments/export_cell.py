"""``bsa export``: the cell that a run found, as a file for other programs."""

from dataclasses import replace
from pathlib import Path

import numpy as np

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
    from ..plugins.pybamm.bpx_export import to_bpx
    from ..plugins.pybamm.export import as_json
    from ..plugins.pybamm.nameplate import labelled, widened_cut_offs
    from ..plugins.pybamm.parameter_files import parsed
    from ..plugins.pybamm.state_of_charge import changed_values

    run = read_finished(folder)
    cell, experiment, change = run.task.cell, run.task.experiments[0], run.task.space.change(run.best.candidate)
    if to == "parameter-values":
        left_out = [f"A parameter set holds no effect; the fit had {', '.join(cell.effects)}."] * bool(cell.effects)
        return as_json(labelled(changed_values(cell, change), cell)), tuple(left_out)
    found = to_bpx(cell, change, experiment, run.task.name)
    soc = change.soc_of(experiment.name)
    started = experiment if soc is None else replace(experiment, initial_soc=soc)
    read_back = replace(cell, parameter_set=parsed(FILES["bpx"], found.text), overrides=widened_cut_offs(cell))
    largest = largest_difference_mv(started, (cell, change), (read_back, type(change)()))
    if largest is None:
        return found.text, (*found.left_out, "The file's cell could not be simulated on the first record.")
    words = f"Read back and simulated on the first record, the file is within {largest:.2g} mV of the run's own cell"
    return found.text, (*found.left_out, words + (": more than tables explain." if largest > TOLERANCE_MV else "."))


def largest_difference_mv(
    experiment: Experiment, ours: tuple[CellModel, CellChange], theirs: tuple[CellModel, CellChange]
) -> float | None:
    """The largest difference of two changed cells' voltages on a record, mV; None where one cannot be simulated.

    Under a protocol both pass the current that the first one passes: its steps end a little earlier in the one cell
    than in the other, and voltages behind them, compared at equal times, would differ by all that a step changes.
    """
    from ..plugins.pybamm.solving import solve_reference

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
    return 1e3 * float(np.max(np.abs(first - second)))
