"""What one evaluation costs, against PyBaMM by itself; and what the loop adds to a round."""

import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from ...backends.rules.backend import RulesBackend
from ...core.run.run_config import RunConfig
from ...core.scaffold import load_scaffold
from ...plugins.pybamm.simulators.worker import CandidateService, WorkerPool
from ...plugins.pybamm.solving.compiled import CompiledExperiment
from ...plugins.pybamm.solving.experiment_kinds import solve_reference
from ..campaign.summary import Row
from ..campaign.text_tables import markdown_table
from ..campaign.trace import Stopwatch
from ..run import execute_run
from ..tasks.find import find_task


def measure(folder: Path, task_name: str, repeats: int) -> dict[str, Any]:
    """What one evaluation of a task costs, as a row: medians on one machine, each way timed after the other.

    The task is named as ``bsa run`` takes it; ``folder`` is not needed.
    """
    task = find_task(task_name)
    (experiment, *_), candidate = task.experiments, task.space.initial
    compiled = CompiledExperiment(task.cell, experiment, task.space.targets)
    compiled.solve(candidate)
    inputs = compiled.cell.inputs(candidate)
    # Near the start, where candidates of a fit lie; alike for one worker and for two.
    rng = np.random.default_rng(repeats)
    batch = [task.space.project({k: v * rng.uniform(0.98, 1.02) for k, v in candidate.items()}) for _ in range(8)]
    service = CandidateService(task.cell, (experiment,), task.space.targets)
    with closing(WorkerPool(service, 1, 60.0)) as one, closing(WorkerPool(service, 2, 60.0)) as two:
        list(one.simulate([candidate]))  # A worker compiles with its first candidate.
        list(two.simulate([candidate] * 2))
        solver_s, evaluation_s, worker_s = _medians(
            repeats,
            lambda: compiled.simulation.solve(inputs=inputs, calc_esoh=False),
            lambda: compiled.solve(candidate),
            lambda: list(one.simulate([candidate])),
        )
        alone_s, together_s = _medians(
            max(repeats // 5, 3), lambda: list(one.simulate(batch)), lambda: list(two.simulate(batch))
        )
    (rebuild_s,) = _medians(
        max(repeats // 5, 2), lambda: solve_reference(task.cell, experiment, task.space.change(candidate))
    )
    row = {
        "solver_s": solver_s,  # PyBaMM's own solve of the compiled model: the floor.
        "evaluation_s": evaluation_s,  # Our evaluation in the same process: solve and trajectory.
        "worker_s": worker_s,  # The same through a worker process, as runs do it.
        "rebuild_s": rebuild_s,  # Building the model for every evaluation, on the standard mesh.
        "two_workers": alone_s / together_s,  # How many times as fast two worker processes get through a batch.
        "loop_s": _loop_cost(task_name),  # What the loop, the memories, the rules and the journal add to a round.
        "repeats": repeats,
    }
    return {"rows": [row], "summary": f"{evaluation_s:.3f} s an evaluation"}


def evaluation_table(rows: Sequence[Row]) -> str:
    """Times of one evaluation, by PyBaMM's own solve."""
    (row,) = rows
    solve = row["solver_s"]
    lines = [
        ["PyBaMM's own solve of the compiled model", f"{solve:.3f} s"],
        ["our evaluation, in one process", f"{row['evaluation_s'] / solve:.2f} of it"],
        ["the same through a worker process", f"{row['worker_s'] / solve:.2f}"],
        ["building the model for every evaluation", f"{row['rebuild_s'] / solve:.1f}"],
        ["simulations a second, two workers to one (aim 1.7)", f"{row['two_workers']:.2f}"],
        ["the loop's own cost a round", f"{1e3 * row['loop_s']:.0f} ms"],
    ]
    return markdown_table([f"one evaluation, medians of {row['repeats']:.0f}", ""], lines)


def _medians(repeats: int, *actions: Callable[[], object]) -> list[float]:
    """Median time of each action, s. They take turns, so that a machine that slows down slows all of them."""
    times: list[list[float]] = [[] for _ in actions]
    for _ in range(repeats):
        for place, action in enumerate(actions):
            started = time.perf_counter()
            action()
            times[place].append(time.perf_counter() - started)
    return [float(np.median(found)) for found in times]


def _loop_cost(task_name: str) -> float:
    """Median over the rounds of a run, less what the simulator and the backend took, s."""
    stopwatch = Stopwatch()
    config = RunConfig(scaffold=load_scaffold("full"), rounds=20, warm_up=10, simulations=31, patience=20)
    with tempfile.TemporaryDirectory() as folder:
        result = execute_run(find_task(task_name), config, Path(folder) / "run", RulesBackend(), listener=stopwatch)
    searched = [trial for trial in result.trials if trial.phase == "search"]
    own_s = [
        timed.round_s - timed.backend_s - sum(trial.seconds for trial in searched if trial.round == number)
        for number, timed in enumerate(stopwatch.rounds, start=1)
    ]
    return float(np.median(own_s))
