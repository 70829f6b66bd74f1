"""A discovery over a life: which mechanism ages a cell."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace

from ..backends.opening import open_backend
from ..core.ageing.changes import Changes
from ..core.contracts.effect_choice import effects_of
from ..core.contracts.requests import Answering, LifeRequest, LifeResiduals
from ..core.discovery.findings import Listener, Nomination
from ..core.discovery.life import LifeEngine, Simulate
from ..core.discovery.life_discovery import LifeDiscovery
from ..core.effect import Effect, Evidence
from ..core.errors import BsaError
from ..core.parameters import Candidate
from ..core.printable import rounded
from ..core.run.journal import OpenJournal
from ..core.run.recorded import RecordedSimulator
from ..core.task import Task
from ..core.task_reduction import shortened
from ..core.trajectory import FloatArray
from ..plugins.pybamm.cells.parameter_sets import pybamm
from ..plugins.pybamm.export.calibrated_script import script
from ..plugins.pybamm.simulators.life_simulator import LifeSimulatorPool
from .degradation_modes import degradation_modes
from .discovery_case import DiscoverOptions, read_life
from .discovery_setup import say_notes
from .report.page import FILE_NAME as REPORT
from .run import Resources, execute_run
from .run_settings import run_config
from .told_run import ToldRun
from .told_simulations import ToldSimulations

CELL = "cell"
"""Folder of the run that fits the cell, in that of the discovery."""

FITTED = 0.6
"""Share of a life that is fitted where nothing else is said: the later cycles tell mechanisms apart by where they
lead."""

_CELL_SIMULATIONS = 60
"""Simulations of the first cycle, by which the cell is fitted: two Jacobians of some twenty-five parameters."""


def discover_over_life(
    options: DiscoverOptions, journal: OpenJournal, listener: ToldSimulations, workers: int
) -> LifeDiscovery:
    """Fit the cell to the first cycle of a life, then each mechanism to the fitted cycles, and say which one it is."""
    pybamm.set_logging_level("CRITICAL")
    task = read_life(options)
    notes = list(task.notes)
    # What is wrong with the options is said before the first simulation.
    fit_cycles, considered = _fit_cycles(task, options.fit_cycles), _considered(task, options, notes)
    say_notes(notes, listener)
    listener("fitting the cell to its first cycle")
    cell = _first_cycle(task, options, workers, listener)
    with closing(LifeSimulatorPool(task, workers)) as pool:
        simulator = RecordedSimulator(pool, LifeResiduals, journal.file, journal.earlier, listener.simulated)
        simulate = _simulating(simulator, cell)
        (new,) = simulate((), [{}])
        if new is None:
            raise BsaError(
                "the cell that fits the first cycle does not run through its life.", f"see {options.out / CELL}."
            )
        kept = task.experiments[0].target.cycles[1:]
        listener(f"fitting what was lost to each of {len(kept)} cycles alone, from cycle {kept[0]} to {kept[-1]}")
        modes = degradation_modes(task, cell, simulator)
        for mode in modes:
            trend, half = rounded(mode.per_100_cycles, 2, sign=True), rounded(mode.half_per_100_cycles, 1)
            listener(f"{mode.name}: {trend} ± {half} in 100 cycles")
        listener(f"fitting mechanisms to the cycles up to {fit_cycles}")
        changes = Changes(task, fit_cycles, new)
        engine = LifeEngine(simulate, changes, listener, options.max_effects, simulator.at_once)
        findings = engine.run([one.effect for one in considered if not one.lacks])
    tried = tuple(one.effect.key for one in findings.nominations)
    findings.nominations += [one for one in considered if one.lacks]
    notes += [f"not built: {name}: {why}" for name, why in simulator.refused.items()]
    found = LifeDiscovery(
        findings,
        tuple(modes),
        fit_cycles,
        cell,
        tried=tried,
        notes=notes,
        restricted=options.effects is not None,
        simulations=simulator.simulations,
    )
    found.script = script(task, found.parameters, findings.best.effects, "augmented_model.py")
    return found


def _fit_cycles(task: Task, asked: int | None) -> int:
    """The last cycle that is fitted: what changes shows between two kept cycles, and another one is held out."""
    kept = task.experiments[0].target.cycles
    fit_cycles = asked or round(FITTED * kept[-1])
    if not kept[1] <= fit_cycles < kept[-1]:
        raise BsaError(
            f"{fit_cycles} of {kept[-1]} cycles are to be fitted.", f"give --fit-cycles {kept[1]} to {kept[-1] - 1}."
        )
    return fit_cycles


def _considered(task: Task, options: DiscoverOptions, notes: list[str]) -> list[Nomination]:
    """All effects of ageing, or those that were named, each with why it cannot be the mechanism, if so."""
    evidence = Evidence(task.cell.model, task.cell.options, task.experiments[0].target.cycles[-1], 0.0, 1.0, life=True)
    effects = effects_of(options.effects, None, options.effect_options, notes.append)
    idle = "does not change the cell from cycle to cycle"
    asked = [effect for effect in effects if effect.ages or options.effects]
    return [Nomination(effect, effect.lacking(evidence) if effect.ages else idle) for effect in asked]


def _simulating(simulator: Answering[LifeRequest, LifeResiduals], cell: Candidate) -> Simulate:
    """The residuals of a life, for strengths of effects in a cell that stays."""

    def simulate(effects: tuple[Effect, ...], candidates: Sequence[Candidate]) -> list[FloatArray | None]:
        found = simulator.predict([LifeRequest(effects, {**cell, **candidate}) for candidate in candidates])
        return [None if one is None else one.residual for one in found]

    return simulate


def _first_cycle(task: Task, options: DiscoverOptions, workers: int, listener: Listener) -> Candidate:
    """The cell that shows the first cycle best, by a run in a folder of its own, which is resumed like any other."""
    (experiment,) = task.experiments
    first = shortened(experiment, experiment.target.steps[0].cycle)
    alone = replace(task, name=f"{task.name}, first cycle", experiments=(first,), held_out=())
    budget = {"rounds": _CELL_SIMULATIONS, "simulations": _CELL_SIMULATIONS, "proposer.options.order": ["joint"]}
    config = run_config("ageing", "rules", {}, budget)
    told = ToldRun(alone, _CELL_SIMULATIONS, listener)
    found = execute_run(alone, config, options.out / CELL, open_backend("rules", {}), Resources(workers), told)
    if found.status == "interrupted":
        raise KeyboardInterrupt
    if not found.best.ok:
        raise BsaError("no simulation of the first cycle ran to its end.", f"see {options.out / CELL / REPORT}.")
    return found.best.candidate
