"""Writes blind cases: records as a cycler would export them, and the answers in a sealed file."""

import base64
import json
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pybamm
from scipy.constants import zero_Celsius

from ...core.discovery.observations import observe
from ...core.discovery.simulator import MeasuredRecord
from ...core.errors import BsaError
from ...core.files import entries, foreign, write_json, write_text
from ...core.segmentation import segment
from ...core.trajectory import FloatArray, Trajectory
from .draws import Draw, draw
from .hidden_cell import measure
from .protocols import protocol

Drawn = Callable[[int, int, int], Draw]
"""A case from the seed of a set, the case's number, and which attempt it is."""

SEALED = "answers.sealed"
DESCRIPTION = "case.json"

CASES = 200
POINTS = 300
"""Averages of a record that a discovery on a case fits."""

_DRAWS = 6
"""Draws of a hidden cell before a case is given up."""


def make_cases(
    folder: Path,
    count: int = CASES,
    seed: int = 2026,
    listener: Callable[[str], None] = lambda text: None,
    drawn: Drawn = draw,
) -> list[Path]:
    """Make the first ``count`` cases of a seed and seal the answers; cases that are there already are kept.

    Each case is a folder with its records, ``holdout.csv`` and ``case.json`` (parameter set, model, ambient
    temperatures), which say nothing of what is hidden. Where a hidden cell cannot be simulated another one is drawn.
    Raises `BsaError` if the folder holds other things, or cases of another seed.
    """
    found = any(folder.glob(f"case_*/{DESCRIPTION}"))
    if entries(folder) and not found:
        raise foreign(folder, "a folder of blind cases")
    pybamm.set_logging_level("CRITICAL")
    answers = _known(folder, seed) if found else {}
    made = []
    for number in range(count):
        name = f"case_{number + 1:03d}"
        if name in answers:
            continue
        answers[name] = _first_that_runs(folder / name, seed, number, listener, drawn)
        _seal(folder, seed, answers)
        made.append(folder / name)
        listener(f"{name} made")
    return made


def _known(folder: Path, seed: int) -> dict[str, Any]:
    content = _opened(folder)
    if content.get("seed") != seed:
        raise BsaError(
            f"{folder} holds cases of seed {content.get('seed')}, not {seed}.", "give that seed, or another folder."
        )
    return dict(content["answers"])


def _seal(folder: Path, seed: int, answers: dict[str, Any]) -> None:
    text = json.dumps({"seed": seed, "answers": answers})
    write_text(folder / SEALED, base64.b64encode(zlib.compress(text.encode())).decode())


def _first_that_runs(
    folder: Path, seed: int, number: int, listener: Callable[[str], None], drawn: Drawn
) -> dict[str, Any]:
    for attempt in range(_DRAWS):
        try:
            return _make(folder, drawn(seed, number, attempt), np.random.default_rng([seed, number, attempt, 3]))
        except (pybamm.SolverError, BsaError, ValueError, IndexError) as error:
            listener(f"{folder.name}: draw {attempt + 1} failed ({type(error).__name__})")
    raise BsaError(f"{folder.name} could not be simulated in {_DRAWS} draws.", "another --seed may do.")


def unseal(folder: Path) -> dict[str, Any]:
    """The answers by case; read when scoring and at no other time."""
    answers = _opened(folder).get("answers")
    if not isinstance(answers, dict):
        raise BsaError(
            f"{folder / SEALED} is of an earlier version, whose cases were no random draws.",
            "make the cases anew: bsa bench discovery make.",
        )
    return answers


def _opened(folder: Path) -> dict[str, Any]:
    path = folder / SEALED
    try:
        content: dict[str, Any] = json.loads(zlib.decompress(base64.b64decode(path.read_bytes())))
    except (OSError, ValueError, zlib.error) as error:
        raise BsaError(f"{path} cannot be read ({error}).", "give a folder of bsa bench discovery make.") from None
    return content


def _make(folder: Path, case: Draw, rng: np.random.Generator) -> dict[str, Any]:
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
