"""One cell of a study: one benchmark case fitted by one method, kept in a folder of its own."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from ...core.errors import BsaError
from ...core.files import entries, foreign, write_json
from ...core.journal import FILE_NAME
from ...core.loop import RunResult
from ...core.messages import Outage
from ...core.metrics import Metrics, PaperMetrics
from ...core.run_config import RunConfig
from ...core.scaffold import Scaffold, load_scaffold
from ..run import Resources, execute_run, versions
from ..suite.build import build_task
from ..suite.case import SuiteCase
from .stopwatch import RoundTime, Stopwatch

RECORD_FILE = "cell.json"


@dataclass(frozen=True)
class StudyCell:
    """A case and a method.

    Attributes
    ----------
    case : SuiteCase
        What is fitted.
    method : str
        Name in the tables, for example ``"cma-es"``.
    config : RunConfig
        Scaffold, backend, budgets and seed.
    search : str
        Search preset; empty for the case's own.
    """

    case: SuiteCase
    method: str
    config: RunConfig
    search: str = ""

    @property
    def identity(self) -> str:
        """A hash of everything that determines the result, 12 hex digits."""
        content = {
            "case": asdict(replace(self.case, changes=dict(self.case.changes))),
            "config": self.config.model_dump(mode="json"),
            "search": self.search,
            "versions": versions(),
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:12]

    def folder(self, out: Path) -> Path:
        """Where the cell's run goes."""
        return out / "runs" / f"{self.case.key}_{self.method}_{self.identity}"


@dataclass(frozen=True)
class CellTrial:
    """What a study needs of one simulation.

    Attributes
    ----------
    candidate : dict of str to float
        The parameter values.
    mape : float or None
        Total MAPE on the search mesh; None after a failure.
    rmse : float or None
        Total RMSE.
    phase : str
        ``"initial"``, ``"warm-up"`` or ``"search"``.
    seconds : float
        Wall time in the simulator.
    """

    candidate: dict[str, float]
    mape: float | None
    rmse: float | None
    phase: str
    seconds: float


@dataclass(frozen=True)
class CellRecord:
    """How a cell ended, as ``cell.json`` keeps it.

    Attributes
    ----------
    identity, case, mode, parameter_set, rates, method : str
        Which cell it is.
    status : str
        How the run ended; ``"no target"`` where PyBaMM cannot simulate the true cell.
    initial, best : dict or None
        `Metrics` with the reference accuracy; None where nothing could be compared.
    best_candidate, truth : dict
        The parameters found and the hidden ones, all searched parameters.
    simulations, failed_simulations, llm_calls, lost_calls, tokens : int
        What was spent.
    wall_s, simulator_s, proposer_s, backend_s : float
        Time from start to end, in simulations, in the proposer without its model, and in the model.
    rounds : list of RoundTime
        Time round by round; empty for a run that was interrupted and resumed.
    trials : list of CellTrial
        Every simulation.
    note : str
        Anything unusual.
    """

    identity: str
    case: str
    mode: str
    parameter_set: str
    rates: str
    method: str
    status: str
    initial: dict[str, float] | None = None
    best: dict[str, float] | None = None
    best_candidate: dict[str, float] = field(default_factory=dict)
    truth: dict[str, float] = field(default_factory=dict)
    simulations: int = 0
    failed_simulations: int = 0
    llm_calls: int = 0
    lost_calls: int = 0
    tokens: int = 0
    wall_s: float = 0.0
    simulator_s: float = 0.0
    proposer_s: float = 0.0
    backend_s: float = 0.0
    rounds: list[RoundTime] = field(default_factory=list)
    trials: list[CellTrial] = field(default_factory=list)
    note: str = ""

    def metric(self, name: str) -> float:
        """A metric of the best candidate; NaN where nothing could be compared."""
        return float("nan") if self.best is None else self.best[name]

    def best_mape_after(self, simulations: int) -> float:
        """Least total MAPE among the first simulations, on the search mesh; NaN where none succeeded."""
        known = [trial.mape for trial in self.trials[:simulations] if trial.mape is not None]
        return min(known, default=float("nan"))


def study_config(
    scaffold: str | Scaffold, simulations: int, seed: int, backend: str, backend_options: dict[str, Any]
) -> RunConfig:
    """The configuration of a cell: the budget is in simulations, and nobody is stopped for want of progress.

    A fifth of the budget goes to the warm-up where a scaffold has one (the paper's 20 of 100).
    """
    return RunConfig(
        scaffold=load_scaffold(scaffold) if isinstance(scaffold, str) else scaffold,
        backend=backend,
        backend_options=backend_options,
        seed=seed,
        rounds=simulations,
        warm_up=simulations // 5,
        simulations=simulations,
        patience=simulations,
    )


def check_study_folder(out: Path) -> None:
    """Refuse a folder that holds anything else than a study; nothing is written.

    Raises
    ------
    BsaError
        If there are files, and no cell of a study.
    """
    cells = (out / "runs").glob("*_*_*")
    if entries(out) and not any(entries(folder) & {RECORD_FILE, FILE_NAME} for folder in cells):
        raise foreign(out, "a study")


def finished(cell: StudyCell, out: Path) -> CellRecord | None:
    """The record of an earlier run of the same cell, if it came to its end."""
    path = cell.folder(out) / RECORD_FILE
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        content["rounds"] = [RoundTime(**entry) for entry in content["rounds"]]
        content["trials"] = [CellTrial(**entry) for entry in content["trials"]]
        record = CellRecord(**content)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return record if record.identity == cell.identity else None


def run_cell(cell: StudyCell, out: Path, simulators: int = 1, keep_runs: bool = False) -> CellRecord:
    """Run a cell, or read its record if it is finished.

    Parameters
    ----------
    cell : StudyCell
        The cell.
    out : Path
        The study's folder.
    simulators : int
        Simulator processes of this cell.
    keep_runs : bool
        Whether journal and report of the finished run are kept (2 MB a cell).

    Raises
    ------
    KeyboardInterrupt
        If the run was interrupted; it resumes where it stopped.
    Outage
        If its language model could not be had; it resumes where it stopped.
    BsaError
        If the method cannot be used.
    """
    record = finished(cell, out)
    if record is not None:
        return record
    folder = cell.folder(out)
    try:
        task = build_task(cell.case, cell.search or None)
    except BsaError as error:
        return _write(folder, _record(cell, "no target", note=error.message))
    resumed = (folder / FILE_NAME).is_file()
    stopwatch = Stopwatch()
    result = execute_run(task, cell.config, folder, _backend(cell.config), Resources(simulators), stopwatch)
    if result.status == "interrupted":
        raise KeyboardInterrupt
    if result.reason:
        raise Outage(result.reason)
    truth = {**task.space.initial, **{name: v for name, v in cell.case.hidden.items() if name in task.space}}
    record = _record(
        cell,
        result.status,
        initial=_numbers(result.initial_metrics),
        best=_numbers(result.best_metrics),
        best_candidate=dict(result.best.candidate),
        truth=truth,
        simulations=len(result.trials),
        failed_simulations=sum(trial.failed for trial in result.trials),
        llm_calls=result.llm_calls,
        lost_calls=result.lost_calls,
        tokens=result.usage.tokens,
        wall_s=result.wall_s,
        simulator_s=result.simulator_s,
        proposer_s=max(0.0, stopwatch.proposer_s - result.usage.seconds),
        backend_s=result.usage.seconds,
        rounds=[] if resumed else stopwatch.rounds,
        trials=_trials(result),
        note="resumed: times are of the last part alone" if resumed else "",
    )
    if not keep_runs:
        shutil.rmtree(folder)
    return _write(folder, record)


def _backend(config: RunConfig) -> Any:
    from ...backends.opening import open_backend

    return open_backend(config.backend, config.backend_options)


def _record(cell: StudyCell, status: str, **content: Any) -> CellRecord:
    case = cell.case
    return CellRecord(
        cell.identity, case.key, case.mode, case.parameter_set, case.rates, cell.method, status, **content
    )


def _numbers(metrics: Metrics | None) -> dict[str, float] | None:
    return None if metrics is None else metrics.as_json()


def _trials(result: RunResult) -> list[CellTrial]:
    scored = [(t, t.metrics if t.ok and isinstance(t.metrics, PaperMetrics) else None) for t in result.trials]
    return [
        CellTrial(
            dict(t.candidate),
            None if metrics is None else metrics.mape,
            None if metrics is None else metrics.rmse,
            t.phase,
            t.seconds,
        )
        for t, metrics in scored
    ]


def _write(folder: Path, record: CellRecord) -> CellRecord:
    write_json(folder / RECORD_FILE, asdict(record))
    return record
