"""A blind case of a simulated cell: its records as a cycler would export them, and its answer."""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pybamm
from scipy.constants import zero_Celsius

from ...core.contracts.requests import MeasuredRecord
from ...core.files import write_json, write_text
from ...core.inference.observations import observe
from ...core.segmentation import segment
from ...core.trajectory import FloatArray, Trajectory
from .draws import Draw, draw
from .hidden_cell import measure
from .making import DESCRIPTION, POINTS
from .protocols import protocol


def make(
    folder: Path, seed: int, number: int, attempt: int, drawn: Callable[[int, int, int], Draw] = draw
) -> dict[str, Any]:
    """Make a case of the cell that is drawn; see `Make`."""
    pybamm.set_logging_level("CRITICAL")
    case, rng = drawn(seed, number, attempt), np.random.default_rng([seed, number, attempt, 3])
    hidden = case.hidden
    values = pybamm.ParameterValues(hidden.parameter_set)
    limits = (float(values["Lower voltage cut-off [V]"]), float(values["Upper voltage cut-off [V]"]))
    files, squares, count = [], 0.0, 0
    conditions = zip(case.protocols, case.ambients_c, case.socs, strict=True)
    for place, (name, ambient_c, soc) in enumerate(conditions, start=1):
        record, exact = measure(hidden, protocol(name, *limits, rng), soc, ambient_c + zero_Celsius, rng)
        held = place == len(case.protocols)
        cut = segment(record)  # a record that cannot even be cut, or that no reader takes, is no test
        if record.voltage.min() < 0.0:
            raise ValueError(f"{record.voltage.min():.3f} V is no voltage of a single cell")
        if not held:
            more, averages = _noise_cost(cut, exact, ambient_c)
            squares, count = squares + more, count + averages
        file = "holdout.csv" if held else f"record_{place}.csv"
        _write(folder / file, record)
        files.append({"file": file, "ambient_c": ambient_c})
    write_json(
        folder / DESCRIPTION, {"parameters": hidden.parameter_set, "model": hidden.model, "records": files}, indent=1
    )
    return {
        "setting": case.setting,
        "model": hidden.model,
        "keys": [effect.key for effect in hidden.effects],
        "names": [effect.name for effect in hidden.effects],
        "strengths": {effect.key: [effect.strength, hidden.strength(effect)] for effect in hidden.effects},
        "shifts": dict(hidden.shifts),
        "noise_v": hidden.noise_v,
        "outside": hidden.outside,
        "outside_strength": hidden.outside_strength,
        "truth_chi2": squares,
        "averages": count,
    }


def _noise_cost(record: Trajectory, exact: FloatArray, ambient_c: float) -> tuple[float, int]:
    """Sum of squares that the true model leaves at the true parameters, as a discovery weighs it, and of how many."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        measured, exactly = (
            MeasuredRecord("record", one, ambient_c + zero_Celsius) for one in (record, record.changed(voltage=exact))
        )
        seen, true = observe(measured, POINTS), observe(exactly, POINTS)
    return float(np.sum(((seen.voltage - true.voltage) / seen.sigma) ** 2)), len(seen)


def _write(path: Path, record: Trajectory) -> None:
    assert record.temperature is not None
    rows = ["Time [s],Current [A],Voltage [V],Temperature [degC]"]
    columns = zip(record.time, -record.current, record.voltage, record.temperature - zero_Celsius, strict=True)
    rows += [f"{t:.4f},{i:.5f},{v:.4f},{c:.2f}" for t, i, v, c in columns]
    write_text(path, "\n".join(rows) + "\n")
