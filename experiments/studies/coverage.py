"""``bsa bench coverage``: how often 95 % intervals contain the truth, on noisy tasks that no fit has seen.

A task is a cell whose parameters were changed, cycled once and sampled as a cycler does. Its record is simulated on a
finer mesh and at tighter tolerances than any fit uses, and noise is added. In three tasks of four the nine parameters
of a geometry are fitted by least squares; in the fourth a measured cell with up to 23 parameters, whose truth is drawn
from their priors, is fitted in stages to its current, and the unseen discharge is given by its current too. That fit
begins from a cell of the record's size, as that of a measured record does. What is said of each parameter, and of the
voltage at a rate that was not measured, is compared with the truth.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from ...backends.opening import open_backend
from ...core.cell import VOLTAGE
from ...core.comparison.residuals import noise_of_residuals, residuals
from ...core.inference.identifiability import Verdict
from ...core.inference.prediction import band_of
from ...core.parameters import Candidate, Parameter, ParameterSpace
from ...core.record import Record
from ...core.run.loop import RunResult
from ...core.run.run_config import RunConfig
from ...core.scaffold import load_scaffold
from ...core.simulation import ExperimentRun, Outcome
from ...core.target import INITIAL_SOC, CellChange, InitialSoc, InitialVoltage, soc_name
from ...core.task import CellModel, Experiment, Task
from ...core.trajectory import FloatArray, Trajectory
from ...plugins.pybamm.before_search.presets import preset_space
from ...plugins.pybamm.cells.parameter_sets import load
from ...plugins.pybamm.cells.state_of_charge import equilibrium_capacity_ah
from ...plugins.pybamm.modelling.resolution import Resolution
from ...plugins.pybamm.solving.compiled import CompiledExperiment
from ...plugins.pybamm.solving.experiment_kinds import compiled
from ..campaign.running import Plan
from ..campaign.study_cell import StudyCell, plan_study
from ..campaign.summary import exact_bounds, grouped
from ..campaign.text_tables import markdown_table
from ..run import execute_run
from ..tasks.cell_for_records import WIDTH
from ..tasks.cell_size import size_factor

BASES = ("Chen2020", "OKane2022", "Marquis2019", "Mohtat2020", "Ai2020")
"""Base cells, taken in turn."""

NOISE_V = (3e-4, 1e-3, 3e-3)
"""From a good cycler's noise to a poor one's."""

SAMPLING_S = (5.0, 10.0, 20.0, 30.0)
RATES = (0.5, 1.0)
"""Of the charge and of the discharge that are fitted."""

UNSEEN_RATE = 2.0
"""C-rate of the discharge at which the voltage is predicted."""

_SHARES = (0.2, 0.5, 0.8)
"""Of the unseen discharge, where its voltage is compared."""

_REACH, _WITHIN = 0.25, (0.1, 0.9)
"""How far a true value lies from the base cell's at most, and where, in the units of the searched range."""

FIT_POINTS = 20
"""Mesh points of a fit in every domain: PyBaMM's own. Under a measured current particles have twice as many, which are
finer at the surface, and so have those of the truth then."""

_ATTEMPTS = 20

_MEASURED = "measured"
"""Name of the record that is fitted."""

_CELL_EVERY = 4
"""One task in so many is a measured cell with 13 to 23 parameters, driven by its current; the others have nine."""

_CELL_OPTIONS = {"contact resistance": "true"}

_CELL_SOC = 0.2
"""State of charge at which a measured cell's record starts, give or take its prior."""

_CORRECTION = "OCP correction"

_VOLTAGE, _BAND = "voltage", "voltage, with misfit"
"""Grades of what is said of the unseen voltage: what the parameters leave open, and the band that is shown."""

Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Drawn:
    """A task with its truth."""

    told: Row  # How it was drawn, as the first columns of its rows.
    task: Task  # What is fitted.
    truth: Candidate  # The true value of every searched parameter.
    unseen: Experiment  # A discharge that was not measured; its target is the truth.
    unseen_v: FloatArray  # Its true voltage at `_SHARES` of its duration, V.
    unseen_s: FloatArray  # When that is, s.

    @property
    def scaffold(self) -> str:
        """What fits it: `staged` a measured cell, `least-squares` a changed geometry."""
        return "staged" if self.task.given_drive else "least-squares"


def draw(seed: int, number: int, model: str, points: int) -> Drawn:
    """The task of a number, whose truth has so many mesh points; it depends on nothing but its arguments.

    Raises `RuntimeError` if no drawn cell could be simulated.
    """
    rng = np.random.default_rng([seed, number])
    base, of_cell = BASES[number % len(BASES)], number % _CELL_EVERY == _CELL_EVERY - 1
    cell = CellModel(base, model, _CELL_OPTIONS if of_cell else {})
    noise_v = NOISE_V[(number // len(BASES)) % len(NOISE_V)]
    sampling_s = float(rng.choice(SAMPLING_S))
    for _ in range(_ATTEMPTS):
        space, truth, changes = (_measured_cell if of_cell else _changed_geometry)(cell, rng)
        experiment, unseen = _experiments(cell, rng, of_cell)
        runs = [_true_run(cell, one, space.change(truth), points, of_cell) for one in (experiment, unseen)]
        if all(run.failure is None for run in runs):
            break
    else:
        raise RuntimeError(f"task {number}: no drawn cell runs")
    clean, unseen_run = (run.trajectory for run in runs)
    assert clean is not None
    assert unseen_run is not None
    record = sampled(clean, sampling_s)
    noisy = record.changed(voltage=record.voltage + rng.normal(0.0, noise_v, len(record)))
    measured, predicted = replace(experiment, target=noisy), replace(unseen, target=unseen_run)
    if of_cell:
        cell, space = _of_its_size(cell, space, noisy)
        measured = replace(measured, protocol=None)
        predicted = replace(predicted, target=sampled(unseen_run, sampling_s), protocol=None)
    seconds = np.array(_SHARES) * unseen_run.duration
    told = {
        "task": number,
        "truth_points": points,  # Of the mesh.
        "base": base,
        "model": model,
        "noise_mv": 1e3 * noise_v,
        "sampling_s": sampling_s,
        "parameters": len(space),
        "changes": changes,  # Parameters that differ from the base cell's.
    }
    task = Task(f"coverage-{number}", cell, space, (measured,))
    return Drawn(told, task, truth, predicted, _signal_at(unseen_run, "voltage", seconds), seconds)


def _changed_geometry(cell: CellModel, rng: np.random.Generator) -> tuple[ParameterSpace, Candidate, int]:
    """The nine parameters of the paper, one to nine of which differ from the base cell's."""
    space = preset_space(cell.parameter_set, "geometry")
    changed = rng.permutation(len(space))[: int(rng.integers(1, len(space) + 1))]
    place = space.to_unit(space.initial)
    place[changed] = np.clip(place[changed] + rng.uniform(-_REACH, _REACH, len(changed)), *_WITHIN)
    return space, space.from_unit(place), len(changed)


def _measured_cell(cell: CellModel, rng: np.random.Generator) -> tuple[ParameterSpace, Candidate, int]:
    """The preset `cell` without some of its corrections of the potentials; all differ as their priors say."""
    whole = preset_space(cell.parameter_set, "cell", options=cell.options)
    corrections = [name for name in whole.names if _CORRECTION in name]
    dropped = set(rng.permutation(corrections)[: int(rng.integers(len(corrections)))])
    # The record starts with a charge of its own, the unseen one full: neither starts at a rest voltage.
    dropped |= {parameter.name for parameter in whole if isinstance(parameter.target, InitialVoltage)}
    space = ParameterSpace(tuple(_of_record(parameter) for parameter in whole if parameter.name not in dropped))
    return space, {parameter.name: _from_prior(parameter, rng) for parameter in space}, len(space)


def _of_its_size(cell: CellModel, space: ParameterSpace, record: Trajectory) -> tuple[CellModel, ParameterSpace]:
    """The cell from which `bsa run` would begin a fit of the record, and the same parameters around it."""
    values, holds_ah = load(cell.parameter_set), equilibrium_capacity_ah(cell.parameter_set, {})
    factor, _ = size_factor([Record(_MEASURED, record)], values, holds_ah, [None])
    sized = replace(cell, overrides={WIDTH: factor * float(values[WIDTH])})
    preset = preset_space(cell.parameter_set, "cell", sized.overrides, cell.options)
    around = {parameter.name: parameter for parameter in preset}
    return sized, ParameterSpace(tuple(around.get(parameter.name, parameter) for parameter in space))


def _of_record(parameter: Parameter) -> Parameter:
    """The same; the state of charge is that at which the measured record starts, since the unseen one starts full."""
    if parameter.name != INITIAL_SOC:
        return parameter
    name = soc_name(_MEASURED)
    return replace(parameter, name=name, initial=_CELL_SOC, target=InitialSoc(_MEASURED))


def _from_prior(parameter: Parameter, rng: np.random.Generator) -> float:
    """A value drawn from a normal prior, which ends at the bounds."""
    while True:
        value = parameter.at_coordinate(float(rng.standard_normal()))
        if parameter.lower < value < parameter.upper:
            return value


def _experiments(cell: CellModel, rng: np.random.Generator, of_cell: bool) -> tuple[Experiment, Experiment]:
    """What is measured, and what is not."""
    values = load(cell.parameter_set)
    high, low = (float(values[f"{which} voltage cut-off [V]"]) for which in ("Upper", "Lower"))
    charge, discharge = rng.choice(RATES, 2)
    cycle = (
        f"Charge at {charge:g}C until {high:g} V",
        f"Hold at {high:g} V until C/20",
        "Rest for 30 minutes",
        f"Discharge at {discharge:g}C until {low:g} V",
        "Rest for 30 minutes",
    )
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    unseen = (f"Discharge at {UNSEEN_RATE:g}C until {low:g} V",)
    return (
        Experiment(_MEASURED, nothing, (cycle,), initial_soc=None if of_cell else 0.05),
        Experiment("unseen", nothing, (unseen,), initial_soc=1.0),
    )


def _true_run(cell: CellModel, experiment: Experiment, change: CellChange, points: int, graded: bool) -> ExperimentRun:
    """The truth, on a finer mesh than the fit's; ``graded`` where the fit follows a measured current."""
    fine = Resolution(rtol=1e-7, points=points, standard_mesh=True, least_atol=1e-7)
    fine = fine.graded() if graded else fine
    return CompiledExperiment(cell, experiment, {}, fine, baked=change).solve({})


def sampled(clean: Trajectory, sampling_s: float) -> Trajectory:
    """A simulation as a cycler logs it: at even times from the start of each step, and where a step ends."""
    times, steps = [], []
    count = 0
    for step, piece in clean.pieces():
        time = np.append(np.arange(piece.time[0], piece.time[-1], sampling_s), piece.time[-1])
        steps.append(replace(step, start=count, stop=count + len(time)))
        times.append(np.stack([time, *(np.interp(time, piece.time, values) for values in piece.signals.values())]))
        count += len(time)
    rows = np.concatenate(times, axis=1)
    return Trajectory(rows[0], steps=tuple(steps), signals=dict(zip(clean.signals, rows[1:], strict=True)))


def _signal_at(run: Trajectory | None, signal: str, seconds: FloatArray) -> FloatArray:
    """A signal at some times; NaN after the end, and where there is none."""
    if run is None or signal not in run.signals:
        return np.full(len(seconds), np.nan)
    return np.interp(seconds, run.time - run.time[0], run.values(signal), right=np.nan)


def fit(drawn: Drawn, simulations: int, seed: int, folder: Path) -> RunResult:
    """What `bsa run` says of a drawn task with its scaffold; the unseen discharge is held out."""
    task = replace(drawn.task, held_out=(drawn.unseen,))
    config = RunConfig(scaffold=load_scaffold(drawn.scaffold), rounds=simulations, simulations=simulations, seed=seed)
    return execute_run(task, config, folder, open_backend(config.backend, {}), report=False, analysing=True)


def rows_of(drawn: Drawn, result: RunResult) -> list[Row]:
    """One row for every interval; none where the fit says nothing."""
    if result.best.residuals is None or result.analysis is None:
        return []
    shared: Row = {
        **drawn.told,
        "scaffold": drawn.scaffold,
        "simulations": len(result.trials),
        "simulations_after": result.analysis.simulations,
        "cost": float(result.best.residuals @ result.best.residuals),
        "true_cost": _cost_of_truth(drawn),
        "ended": int(result.status == "finished"),
        "noise_tolerances": float(np.sqrt(np.mean(noise_of_residuals(drawn.task) ** 2))),
    }
    intervals = result.analysis.identifiability.intervals
    rows = [
        {**shared, "grade": i.verdict, "of": name, **_contained(drawn.truth[name], i.value, i.lower, i.upper)}
        for name, i in intervals.items()
        if name in drawn.truth  # The parameters of an effect that the fit has added have no true values.
    ]
    predicted, name = result.held_out[0], VOLTAGE.name
    values, halves = (_signal_at(predicted.curve, signal, drawn.unseen_s) for signal in (name, band_of(name)))
    # What the fitted record is off by, which is part of the band that is shown.
    misfit = predicted.bands[name].misfit / VOLTAGE.shown_scale if name in predicted.bands else np.nan
    for second, true, value, left_open in zip(drawn.unseen_s, drawn.unseen_v, values, halves, strict=True):
        of = f"voltage after {second:.0f} s at {UNSEEN_RATE:g}C"
        for grade, half in ((_VOLTAGE, left_open), (_BAND, float(np.hypot(left_open, misfit)))):
            if np.isfinite(value) and np.isfinite(half):
                rows.append({**shared, "grade": grade, "of": of, **_contained(true, value, value - half, value + half)})
    return rows


def _cost_of_truth(drawn: Drawn) -> float:
    """What the truth costs on the mesh of the fit; NaN if it cannot be simulated there."""
    task = drawn.task
    runs = [compiled(task.cell, experiment, task.space.targets).solve(drawn.truth) for experiment in task.experiments]
    found = residuals(task, Outcome(tuple(runs)))
    return float("nan") if found is None else float(found @ found)


def _contained(true: float, value: float, lower: float, upper: float) -> Row:
    return {"true": true, "value": value, "lower": lower, "upper": upper, "contained": int(lower <= true <= upper)}


def one_task(folder: Path, seed: int, number: int, model: str, points: int, simulations: int) -> dict[str, Any]:
    """Draw a task, fit it, and compare; what is kept of it."""
    try:
        drawn = draw(seed, number, model, points)
    except RuntimeError as error:
        return {"rows": [], "summary": str(error)}
    result = fit(drawn, simulations, seed, folder / "fit")
    rows = rows_of(drawn, result)
    contained = sum(row["contained"] for row in rows)
    return {"rows": rows, "summary": f"{contained} of {len(rows)} intervals contain the truth; {result.status}"}


def plan_coverage(store: Path, count: int, seed: int, model: str, points: int, simulations: int) -> Plan[StudyCell]:
    """A cell for every task."""
    asked = {"seed": seed, "model": model, "points": points, "simulations": simulations}
    return plan_study("coverage", one_task, {f"task-{n}": {**asked, "number": n} for n in range(count)}, store)


def coverage_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """The share of intervals that contain the truth, by grade, with its bounds.

    And how far from the middle the truth lies in the median, which tells intervals that are wider than they need be.
    """
    groups = grouped(rows, "grade")
    lines = []
    for grade in (*get_args(Verdict), _VOLTAGE, _BAND):
        members = groups.get(grade, [])
        found = [int(row["contained"]) for row in members]
        if found:
            share = f"{100 * sum(found) / len(found):.0f} %"
            off = f"{np.median([_off_middle(row) for row in members]):.2f}"
            lines.append([grade, str(len(found)), share, _bounds(members), off])
    heads = ["grade", "intervals", "contain the truth", "95 % bounds", "truth off the middle / half widths, median"]
    return markdown_table(heads, lines)


def _bounds(rows: Sequence[Mapping[str, Any]]) -> str:
    """Bounds of a share of intervals, in percent, where those of one task miss the truth together.

    Exact bounds of as many independent intervals as have the variance of the share over tasks (Korn and Graubard, Surv.
    Methodol. 24 (1998) 193); where all contain the truth, of as many as there are tasks.
    """
    tasks = grouped(rows, "task").values()
    share = sum(int(row["contained"]) for row in rows) / len(rows)
    off = np.array([sum(int(row["contained"]) - share for row in of_task) for of_task in tasks])
    variance = float(off @ off) / len(rows) ** 2 * len(off) / max(len(off) - 1, 1)
    of_one, most = share * (1.0 - share), float(len(rows))
    independent = len(off) if of_one == 0.0 else most if of_one >= most * variance else of_one / variance
    low, high = exact_bounds(share * independent, independent)
    return f"{100 * low:.0f} to {100 * high:.0f} %"


def _off_middle(row: Mapping[str, Any]) -> float:
    """Distance of the truth from an interval's middle, in half widths; the median is 0.34 where errors are normal."""
    lower, upper = float(row["lower"]), float(row["upper"])
    return abs(2.0 * float(row["true"]) - lower - upper) / (upper - lower)


def excesses(rows: Sequence[Mapping[str, Any]]) -> list[float]:
    """By task: cost of the fit over that of the truth, less one."""
    return [found[0]["cost"] / found[0]["true_cost"] - 1.0 for found in grouped(rows, "task").values()]
