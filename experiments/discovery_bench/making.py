"""Writes blind cases: records as a cycler would export them, and the answers in a sealed file."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import BsaError
from ...core.files import entries, foreign, write_json, write_text
from ...core.segmentation import segment
from ...core.trajectory import Trajectory
from .cases import Recipe, base_cell, hide, recipes
from .hidden_cell import measure
from .profiles import legs

SEALED = "answers.sealed"
DESCRIPTION = "case.json"

_DRAWS = 4
"""Draws of a hidden cell's base parameters before a case is given up."""


def make_cases(
    folder: Path, count: int | None = None, seed: int = 2026, listener: Callable[[str], None] = lambda text: None
) -> list[Path]:
    """Make the first ``count`` cases (all by default) and seal the answers.

    Each case is a folder with its records, ``holdout.csv`` and ``case.json`` (parameter set, model, ambient
    temperatures), which say nothing of what is hidden. Where a hidden cell cannot be simulated another draw of
    its base parameters is tried.
    """
    from ...plugins.pybamm.parameter_sets import pybamm
    from ..effect_choice import effects_of

    if entries(folder) and not any(folder.glob(f"case_*/{DESCRIPTION}")):
        raise foreign(folder, "a folder of blind cases")
    pybamm.set_logging_level("CRITICAL")
    effects = effects_of(None)
    answers: dict[str, Any] = {}
    made = []
    for number, recipe in enumerate(list(recipes())[:count], start=1):
        name = f"case_{number:02d}"
        for attempt in range(_DRAWS):
            rng = np.random.default_rng([seed, number, attempt])
            try:
                answers[name] = _make(folder / name, recipe, effects, rng)
            except (pybamm.SolverError, BsaError, ValueError, IndexError) as error:
                listener(f"{name}: draw {attempt + 1} failed ({type(error).__name__})")
                continue
            made.append(folder / name)
            listener(f"{name} made")
            break
        else:
            raise BsaError(f"{name} could not be simulated in {_DRAWS} draws.", "another --seed may do.")
    write_text(folder / SEALED, base64.b64encode(zlib.compress(json.dumps(answers).encode())).decode())
    return made


def unseal(folder: Path) -> dict[str, Any]:
    """The answers; read when scoring and at no other time."""
    path = folder / SEALED
    try:
        content: dict[str, Any] = json.loads(zlib.decompress(base64.b64decode(path.read_bytes())))
    except (OSError, ValueError, zlib.error) as error:
        raise BsaError(f"{path} cannot be read ({error}).", "give a folder of bsa bench discovery make.") from None
    return content


def read_rows(folder: Path, results: str) -> list[dict[str, Any]]:
    """What was written of each case, one JSON object a line; none if there is no such file yet.

    Raises
    ------
    BsaError
        If ``results`` is no name of a file in the folder, or its content is not ours.
    """
    path = folder / results
    if Path(results).name != results or path.is_symlink():
        raise BsaError(f'"{results}" is no file in {folder}.', "give a name, without a path.")
    try:
        rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []
    except (OSError, ValueError, RecursionError) as error:
        raise BsaError(f"{path} cannot be read ({error}).", "choose another name with --results.") from None
    if not all(isinstance(row, dict) and isinstance(row.get("case"), str) for row in rows):
        raise foreign(path, "a file of results")
    return rows


def _make(folder: Path, recipe: Recipe, effects: Any, rng: np.random.Generator) -> dict[str, Any]:
    from ...plugins.pybamm.parameter_sets import load

    cell = base_cell(recipe)
    values = load(cell.parameter_set)
    lower, upper = float(values["Lower voltage cut-off [V]"]), float(values["Upper voltage cut-off [V]"])
    hidden = hide(recipe, effects, float(values["Nominal cell capacity [A.h]"]), rng)
    ambients = recipe.ambients_c or (25.0,) * (len(recipe.profiles) + 1)
    files = []
    for profile, ambient in zip((*recipe.profiles, "check"), ambients, strict=True):
        soc = float(rng.uniform(0.88, 0.96)) if profile != "ageing" else 0.95
        record = measure(cell, hidden, legs(profile, lower, upper, rng), soc, ambient + 273.15, rng)
        segment(record)  # a record that cannot even be cut is no test
        name = "holdout.csv" if profile == "check" else f"{profile}.csv"
        _write(folder / name, record)
        files.append({"file": name, "ambient_c": ambient})
    description = {"parameters": cell.parameter_set, "model": cell.model, "records": files}
    write_json(folder / DESCRIPTION, description, indent=1)
    return {
        "effects": [effect.name for effect in hidden.effects],
        "keys": [effect.key for effect in hidden.effects],
        "strengths": dict(hidden.strengths),
        "shifts": dict(hidden.shifts),
        "noise_v": hidden.noise_v,
        "outside": hidden.outside,
        "setting": recipe.setting,
    }


def _write(path: Path, record: Trajectory) -> None:
    assert record.temperature is not None
    rows = ["Time [s],Current [A],Voltage [V],Temperature [degC]"]
    columns = zip(record.time, -record.current, record.voltage, record.temperature - 273.15, strict=True)
    rows += [f"{t:.4f},{i:.5f},{v:.4f},{c:.2f}" for t, i, v, c in columns]
    write_text(path, "\n".join(rows) + "\n")
