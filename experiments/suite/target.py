"""Targets, made on an independent path: PyBaMM's standard mesh at tighter tolerance than any fit uses.

A target costs seconds, so each is kept on disk under a hash of everything it depends on: cell, protocol, the version of
PyBaMM, and the sources that simulate it.
"""

import os
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ...core.ageing.choice import kept_cycles
from ...core.encoding import decode_outcome, encode_cell, encode_outcome
from ...core.errors import BsaError
from ...core.files import read_json, write_json
from ...core.parameters import Candidate
from ...core.run.run_config import hash_of
from ...core.shape import decoding
from ...core.simulation import ExperimentRun, Outcome
from ...core.target import change_of, target_named
from ...core.task import CellModel, Experiment
from ...core.trajectory import StepKind, Trajectory
from ..source_digest import package_digest
from .case import SuiteCase, protocol

_FORMAT = 2

_RTOL, _ATOL = 1e-7, 1e-7
"""Ten times tighter than the final score. Tighter still in ``atol``, and Ecker2015 fails in its first rest."""

_DECISIVE = ("core", "plugins/pybamm", "experiments/suite")
"""The sources that decide what a target is."""


def cell_of(case: SuiteCase) -> CellModel:
    """The cell model that a search starts from."""
    return CellModel(case.parameter_set, "DFN", case.options)


def experiment_of(case: SuiteCase) -> Experiment:
    """The case's experiment without its target."""
    from ...plugins.pybamm.cells.parameter_sets import load

    values = load(case.parameter_set)
    nothing = np.zeros(1)
    return Experiment(
        name=case.rates,
        target=Trajectory(nothing, nothing, nothing),
        protocol=protocol(
            case.charge_rate,
            case.discharge_rate,
            float(values["Upper voltage cut-off [V]"]),
            float(values["Lower voltage cut-off [V]"]),
            case.cycles,
        ),
        scored_cycle=None if case.ages else 2,
        temperature_k=case.temperature_k,
        detailed_cycles=kept_cycles(case.cycles) if case.ages else (),
    )


def target_of(case: SuiteCase) -> ExperimentRun:
    """The record that the case asks to match, noise included.

    The trajectory is partial where PyBaMM cannot finish the true cell (one published task).
    """
    run = reference_run(cell_of(case), experiment_of(case), case.hidden)
    if not case.noise_v or run.trajectory is None:
        return run
    return replace(run, trajectory=_noisy(run.trajectory, case.noise_v, case.key))


def reference_run(cell: CellModel, experiment: Experiment, candidate: Candidate) -> ExperimentRun:
    """Simulate on the independent path, or read the result of an earlier call."""
    content = {
        "format": _FORMAT,
        "pybamm": version("pybamm"),
        "code": package_digest(*_DECISIVE),
        "tolerances": [_RTOL, _ATOL],
        "cell": encode_cell(cell),
        "protocol": experiment.protocol,
        "temperature_k": experiment.temperature_k,
        "initial_soc": experiment.initial_soc,
        "candidate": dict(sorted(candidate.items())),
        **({"detailed_cycles": experiment.detailed_cycles} if experiment.long else {}),
    }
    path = cache_folder() / f"{hash_of(content, 32)}.json"
    kept = read_json(path)
    if kept is not None:
        with suppress(BsaError), decoding(path, "a target", ""):  # damaged by a crash of the machine: made again
            return decode_outcome(kept).runs[0]
    run = _solve(cell, experiment, candidate)
    write_json(path, encode_outcome(Outcome((run,))))
    return run


def cache_folder() -> Path:
    """Where targets are kept: ``BSA_CACHE``, or the user's cache folder."""
    chosen = os.environ.get("BSA_CACHE")
    if chosen:
        return Path(chosen) / "targets"
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(base) if base else Path.home() / ".cache") / "battery-sim-agent" / "targets"


def _solve(cell: CellModel, experiment: Experiment, candidate: Candidate) -> ExperimentRun:
    from ...plugins.pybamm.cells.parameter_sets import pybamm
    from ...plugins.pybamm.modelling.resolution import Resolution
    from ...plugins.pybamm.solving.experiment_kinds import solve_reference

    pybamm.set_logging_level("CRITICAL")
    resolution = Resolution(rtol=_RTOL, standard_mesh=True, least_atol=_ATOL)
    change = change_of({name: target_named(name) for name in candidate}, candidate)
    return solve_reference(cell, experiment, change, resolution)


def _noisy(clean: Trajectory, noise_v: float, key: str) -> Trajectory:
    rng = np.random.default_rng(list(key.encode()))
    rng.standard_normal(len(clean))  # Earlier versions drew noise of the current first; targets are to stay the same.
    return clean.changed(voltage=clean.voltage + noise_v * rng.standard_normal(len(clean)))


def discharged_in_scored_part(run: ExperimentRun, experiment: Experiment) -> float | None:
    """Charge of the scored discharge, A.h; None if the cell did not get through.

    Raises `BsaError` if the experiment scores a cycle that it does not have.
    """
    if run.failure is not None or run.trajectory is None:
        return None
    record = run.trajectory
    if experiment.scored_cycle is not None:
        if experiment.scored_cycle not in record.cycles:
            raise BsaError(f"{experiment.name} has no cycle {experiment.scored_cycle}.")
        record = record.cycle(experiment.scored_cycle)
    pieces = [piece for step, piece in record.pieces() if step.kind is StepKind.CC_DISCHARGE]
    return float(sum(piece.discharge_capacity[-1] for piece in pieces))
