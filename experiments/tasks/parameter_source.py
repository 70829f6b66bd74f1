"""Base parameters by what a person gives: an installed set, a file, or an earlier run."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...core.comparison.signal_metrics import voltage_rmse_mv
from ...core.contracts.effect_choice import effects_of
from ...core.encoding import decode_parameter, encode_parameter, encode_task
from ...core.errors import BsaError
from ...core.files import file_error
from ...core.parameters import Parameter, ParameterSpace
from ...core.run.journal import FILE_NAME as JOURNAL
from ...core.target import ALIKE_V, CellChange, CurrentOffset, EffectValue, InitialSoc, InitialVoltage, Target
from ...core.task import NEAREST, ParameterFile, ParameterSource, Task
from ..run_record import RunRecord, read_run
from .influence import simulated_models, with_influence

BEST = "best_parameters.json"

_LARGEST_FILE = 2**24
"""Bytes of a parameter file at most: a thousand times what BPX files have."""


def parameter_source(given: ParameterSource) -> ParameterSource:
    """What ``--parameters`` means.

    A parameter file that is read already stays as it is. Text is the name of an installed set, a JSON file (BPX, or
    PyBaMM's parameter values), a run's folder, or the ``best_parameters.json`` in one. A name of an installed set, or
    ``"nearest"``, is never a folder: ``./Chen2020`` is one. Raises `BsaError` if a file or a run cannot be read.
    """
    if isinstance(given, ParameterFile):
        return given
    path, run = Path(given), run_named(given)
    if run is not None:
        return calibrated(run)
    if path.suffix.lower() != ".json":
        return given
    from ...plugins.pybamm.cells.parameter_files import parsed

    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise BsaError(f"{path} has {path.stat().st_size} bytes.", f"a parameter file has {_LARGEST_FILE} at most.")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise file_error(error, path) from None
    except UnicodeDecodeError:
        raise BsaError(f"{path} is no text in UTF-8.", "give BPX or PyBaMM's parameter values, as JSON.") from None
    return parsed(path.name, text)


@dataclass(frozen=True)
class FoundCell:
    """The cell that a run found: a set of its own, and what no set holds."""

    parameters: ParameterFile
    options: Mapping[str, Any]  # PyBaMM's model options.
    effects: tuple[str, ...]  # Effects in its model, by name.
    strengths: Mapping[str, float]  # Values of their parameters, by full name.
    left_v: float  # Root mean square of the voltage error that the fit left, V; 0 where it compared none.


def found_cell(given: ParameterSource, searched: Sequence[str] = ()) -> FoundCell | None:
    """What `--parameters` means where it names a run; None where it does not. Raises as `calibrated`.

    Effects that are ``searched`` anew have no strengths of the run, see `strengths_of`.
    """
    folder = run_named(given)
    if folder is None:
        return None
    run = read_finished(folder)
    cell = run.task.cell
    assert run.best.metrics is not None  # of a simulation that ran to its end
    left_mv = voltage_rmse_mv(run.best.metrics)
    left_v = 1e-3 * left_mv if math.isfinite(left_mv) else 0.0
    return FoundCell(_without_effects(run), cell.options, cell.effects, strengths_of(run, searched), left_v)


def strengths_of(run: RunRecord, searched: Sequence[str] = ()) -> dict[str, float]:
    """What a run found of its effects, by the full names of their parameters; not of those that are ``searched`` anew.

    Raises `BsaError` if there is no effect of such a name.
    """
    anew = {effect.name for effect in effects_of(searched)}
    own = {p.name: p.target.effect for p in run.task.space if isinstance(p.target, EffectValue)}
    found = {name: run.best.candidate[name] for name, effect in own.items() if effect not in anew}
    return {**run.task.cell.strengths, **found}


def starts_left_out(given: ParameterSource, found: ParameterSource) -> str:
    """What is said of a run whose fitted starts of records the set that it is taken for cannot hold; empty for none.

    ``found`` is what ``given`` means, see `parameter_source`.
    """
    folder = run_named(given)
    if folder is None or not isinstance(found, ParameterFile):
        return ""
    searched = [decode_parameter(one).target for one in json.loads(found.text)["space"]]
    if not any(isinstance(target, InitialSoc | InitialVoltage) for target in searched):
        return ""
    return (
        "the states in which the run's records start were fitted too, and are no part of the cell that --parameters "
        f"takes from the run: they begin anew. To keep them: --start-from {folder}"
    )


def run_named(given: ParameterSource) -> Path | None:
    """The folder of the run that ``--parameters`` means, by it or by its ``best_parameters.json``; None for no run."""
    if isinstance(given, ParameterFile):
        return None
    path = Path(given)
    folder = path.parent if path.name == BEST else path
    return folder if (folder / JOURNAL).is_file() and not names_a_set(given) else None


def names_a_set(given: str) -> bool:
    """Whether this is the name of an installed parameter set, or stands for one: never that of a file or folder."""
    from ...plugins.pybamm.cells.parameter_sets import set_names

    return given in (*set_names(), NEAREST)


def calibrated(folder: Path) -> ParameterFile:
    """The cell that a run found, as a set of its own.

    Raises `BsaError` if the folder holds no run of a PyBaMM cell, or no simulation of it succeeded.
    """
    run = read_finished(folder)
    if run.task.cell.effects:
        raise BsaError(
            f"the model of {run.name} has {', '.join(run.task.cell.effects)} beside its parameters.",
            "no parameter set holds an effect: --start-from RUN and --parameters RUN of bsa run keep it.",
        )
    return _without_effects(run)


def read_finished(folder: Path) -> RunRecord:
    """A run of a PyBaMM cell that found something. Raises `BsaError`: as `calibrated`."""
    run = read_run(folder)
    if not run.task.cell.parameter_set:
        raise BsaError(f"{folder} calibrated no cell of PyBaMM.", "name the run of a PyBaMM cell.")
    if not run.best.ok:
        raise BsaError(f"no simulation of {folder} ran to its end.", "such a run has no best values.")
    return run


def _without_effects(run: RunRecord) -> ParameterFile:
    cell = {
        name: value for name, value in encode_task(run.task)["cell"].items() if name not in ("effects", "strengths")
    }
    content = {
        "cell": cell,
        "space": [encode_parameter(parameter) for parameter in run.task.space],
        "candidate": dict(run.best.candidate),
    }
    return ParameterFile(f"{run.name} ({run.task.cell.parameter_set} calibrated)", "calibrated", json.dumps(content))


def start_from(run: RunRecord, search: str | Mapping[str, Any] | None) -> tuple[ParameterSource, dict[str, float]]:
    """Base parameters and overrides that begin where a run ended.

    Without a search of its own a run goes on with that of the earlier one, around its base. With one the base is the
    calibrated cell, so that what is not searched any more stays as it was found.
    """
    if search is None:
        return run.task.cell.parameter_set, dict(run.task.cell.overrides)
    return _without_effects(run), {}


def with_its_space(task: Task, run: RunRecord, socs_given: bool = False) -> Task:
    """The task with a run's searched parameters, started at the run's best values.

    A record that the run fitted starts at the state of charge that was found; another one where the fitted cell shows
    the open-circuit voltage at which the record starts, unless its state of charge was given.
    """
    searched = any(isinstance(parameter.target, InitialSoc | InitialVoltage) for parameter in run.task.space)
    states = [parameter for parameter in task.space if searched and isinstance(parameter.target, InitialSoc)]
    if not socs_given:
        states = _started_in_the_fitted_cell(states, task, run)
    names = {experiment.name for experiment in task.experiments}
    of_others = [CurrentOffset(one.name) for one in run.task.experiments if one.name not in names]
    found = [
        p
        for p in run.task.space.continued(run.best.candidate)
        if not isinstance(p.target, InitialSoc) and p.target not in of_others
    ]
    corrected = [p.target.near for p in found if isinstance(p.target, InitialVoltage)]
    states += [p for p in task.space if searched and _is_another_start(p.target, corrected)]
    known = {p.name for p in found}
    states += [p for p in task.space if isinstance(p.target, CurrentOffset) and p.name not in known]
    spectra = [experiment.is_spectrum for experiment in task.experiments]
    models = simulated_models(task.cell, not all(spectra), any(spectra))
    space, notes = with_influence(ParameterSpace((*found, *states)), models, "the earlier run")
    return replace(task, space=space, notes=tuple(dict.fromkeys((*task.notes, *notes))))


def _is_another_start(target: Target | None, corrected: Sequence[float | None]) -> bool:
    """Whether a correction is of a rest voltage near which a run has none."""
    if not isinstance(target, InitialVoltage):
        return False
    near = target.near
    return not any(one is None or near is None or abs(one - near) <= ALIKE_V for one in corrected)


def _started_in_the_fitted_cell(states: Sequence[Parameter], task: Task, run: RunRecord) -> list[Parameter]:
    from ...plugins.pybamm.cells.parameter_sets import as_simulated, load
    from ...plugins.pybamm.cells.state_of_charge import InitialState

    set_as_is = InitialState(load(task.cell.parameter_set, task.cell.overrides))
    fitted = as_simulated(run.task.cell, run.task.space.change(run.best.candidate))
    known = {experiment.name: experiment.target for experiment in run.task.experiments}
    started = []
    for state in states:
        records = [e for e in task.experiments if state.target in (InitialSoc(), InitialSoc(e.name))]
        same = records[0].name in known and known[records[0].name].is_same_measurement(records[0].target)
        soc = fitted.soc_of(records[0].name) if same else None
        if soc is None:
            voltage = float(set_as_is.voltages(CellChange(), state.initial, np.zeros(1))[0])
            soc = set_as_is.soc_at(voltage, fitted)
        started.append(replace(state, initial=state.project(soc)))
    return started
