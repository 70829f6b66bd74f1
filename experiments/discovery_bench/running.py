"""Runs the discovery on blind cases, each in a process of its own, and keeps what it said."""

from __future__ import annotations

import json
import multiprocessing
import time
import traceback
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import BsaError
from ...core.messages import Outage
from ...core.parentage import end_with_parent
from ..discover import backend_or_none, discover_on
from ..discovery_case import DiscoverOptions, read_case
from ..discovery_workbench import set_up
from .making import DESCRIPTION, POINTS, read_rows

RESULTS = "results.jsonl"


def run_cases(
    folder: Path,
    work: Callable[[Path], dict[str, Any]],
    workers: int = 2,
    only: list[str] | None = None,
    results: str = RESULTS,
    listener: Callable[[str], None] = lambda text: None,
) -> Path:
    """Work on every case of a folder that has no result yet.

    Parameters
    ----------
    folder : Path
        Made by `make_cases`. The sealed answers are not opened.
    work : callable
        Given a case's folder, returns its row, with ``case`` and what to say of it in ``summary``; `run_case`, for one.
        It must be picklable.
    workers : int
        Processes side by side, a fresh one for each case.
    only : list of str, optional
        Names of cases; all by default.
    results : str
        File in the folder to which one line a case is appended.
    listener : callable
        Told in one line how each case ended.

    Returns
    -------
    Path
        The results.
    """
    path = folder / results
    done = {row["case"] for row in read_rows(folder, results)}
    names = sorted(p.name for p in folder.glob("case_*") if (p / DESCRIPTION).exists())
    if not names:
        raise BsaError(f"{folder} holds no blind case.", "bsa bench discovery make makes some.")
    names = [name for name in names if name not in done and (only is None or name in only)]
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, context, initializer=end_with_parent, max_tasks_per_child=1)
    try:
        jobs = {pool.submit(work, folder / name): name for name in names}
        for job in as_completed(jobs):
            row = job.result()
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            listener(f"{row['case']}: {row['summary']}")
    except KeyboardInterrupt:
        # A case keeps nothing until it ends: to wait for the running ones would be to wait for minutes.
        for process in multiprocessing.active_children():
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return path


def run_case(folder: Path, **asked: Any) -> dict[str, Any]:
    """Run a discovery on one case, with options that are asked for besides; a failure is a row like any other."""
    options = options_of(folder, **asked)
    try:
        bench = set_up(read_case(options), options)
        said: list[str] = []
        with backend_or_none(options) as backend:
            discovery = discover_on(bench, options, said.append, backend)
    except Exception as error:  # a crash is a result of the benchmark, and must not end it
        trace = traceback.format_exc().splitlines()[-3:]
        reason = f"{error} {trace}"
        return {
            "case": folder.name,
            "summary": f"failed: {error}",
            "verdict": "failed",
            "names": [],
            "wall_s": 0.0,
            "error": reason,
        }
    if discovery.ranking is not None and discovery.ranking.lost:
        raise Outage(discovery.ranking.note)
    content = discovery.to_json()
    base = discovery.findings.nearest_base
    return {
        "case": folder.name,
        "summary": f"{discovery.verdict} {list(discovery.names)} {discovery.wall_s:.0f} s",
        "verdict": discovery.verdict,
        "names": list(discovery.names),
        "rivals": [list(rival.names) for rival in discovery.findings.rivals],
        "best": list(discovery.findings.best.names),
        "effects": content["effects"] or content["partial"],
        "gap": content["gap"],
        "base_chi2": float(np.sum(np.square(base.errors / base.sigma))),
        "reason": content["reason"],
        "candidates": [c for c in content["candidates"] if c["refit_rmse_mv"] is not None],
        "scores": [
            [c["name"] + (f" ({c['variant']})" if c["variant"] else ""), c["score"]]
            for c in content["candidates"]
            if c["score"]
        ][:8],
        "ranking": content["backend_ranking"],
        "simulations": discovery.simulations,
        "wall_s": discovery.wall_s,
        "cpu_s": time.process_time(),
        "said": said,
    }


def options_of(folder: Path, **asked: Any) -> DiscoverOptions:
    """What is asked of a case: its last record is held out; ``asked`` are other options."""
    description = json.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
    records = [{"path": folder / r["file"], "read": {"ambient_c": r["ambient_c"]}} for r in description["records"]]
    return DiscoverOptions.model_validate(
        {
            "data": records[:-1],
            "holdout": records[-1:],
            "parameters": description["parameters"],
            "model": description["model"],
            "points": POINTS,
            "out": folder,
            **asked,
        }
    )
