"""A cluster of worker processes gives what this machine gives, and loses nothing when workers die."""

from __future__ import annotations

import json
import os
import random
import signal
import threading
import time
from collections import Counter

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.campaign.dask_pool import DaskPool, SlurmConfig, check_cluster, slurm_cluster
from bsa.experiments.campaign.execution import run_cells
from bsa.experiments.campaign.results import rows_of

from .conftest import Here, Quiet, noted

distributed = pytest.importorskip("distributed", reason='pip install "battery-sim-agent[cluster]"')
Status = distributed.core.Status

NUMBERS = ("task", "method", "seed", "mape", "rmse", "v_rmse_mv", "simulations", "identity")


@pytest.fixture
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, memory_limit="1GB"
    ) as made:
        yield made


def numbers(plan, reports=None):
    rows = rows_of(noted(plan), plan.store, reports)
    return [{name: row[name] for name in NUMBERS} for row in rows]


def once(plan) -> None:
    """Every simulation of every cell stands in its journal once."""
    for cell in plan.cells:
        text = (plan.store.cell(cell.identity) / "journal.jsonl").read_text()
        events = [json.loads(line) for line in text.splitlines()]
        trials = Counter(event["index"] for event in events if event["event"] == "trial")
        result = plan.store.result(cell.identity)
        assert result is not None
        assert trials == Counter(range(result["simulations"]))
        # A worker that dies between a run's last word and its result leaves that word behind; who takes the run up
        # again says so, and has the last one.
        kinds = [event["event"] for event in events if event["event"] in ("resumed", "end")]
        assert kinds[-1] == "end"
        assert ["end", "end"] not in [kinds[k : k + 2] for k in range(len(kinds))]


@pytest.mark.slow
def test_two_workers_five_times_killed_find_the_same(make_plan, cluster):
    settings = {"tasks": 3, "seeds": [1, 2], "rounds": 10, "simulations": 14}
    here, there, rough = (make_plan(store=name, **settings) for name in ("here", "there", "rough"))
    run_cells(here.cells, here.store, Here(), Quiet())
    pool = DaskPool(cluster.scheduler_address)
    assert pool.workers == 2
    reports = run_cells(there.cells, there.store, pool, Quiet())
    assert numbers(there, reports) == numbers(here)
    once(there)

    killed = []
    stop = threading.Event()

    def kill() -> None:
        choose = random.Random(3)
        while len(killed) < 5 and not stop.is_set():
            # A worker killed while it starts takes its nanny with it: Dask then has no one to start it again.
            pids = [nanny.pid for nanny in cluster.workers.values() if nanny.process.status == Status.running]
            # Only while work is under way, and not all of it done before the next blow.
            if pids and len(list(rough.store.root.glob("cells/*/result.json"))) >= 2 * len(killed):
                pid = choose.choice(pids)
                os.kill(pid, signal.SIGKILL)
                killed.append(pid)
            time.sleep(choose.uniform(0.2, 0.6))

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        reports = run_cells(rough.cells, rough.store, pool, Quiet())
    finally:
        stop.set()
        killer.join()
        pool.close()
    assert len(killed) == 5
    assert numbers(rough, reports) == numbers(here)
    once(rough)


@pytest.mark.slow
def test_no_scheduler_is_said_with_what_to_do(monkeypatch):
    monkeypatch.setattr("bsa.experiments.campaign.dask_pool._CONNECT_S", 1)
    with pytest.raises(BsaError, match="dask scheduler"):
        DaskPool("tcp://127.0.0.1:9")
    with pytest.raises(BsaError, match="slurm:FILE"):
        DaskPool("my-cluster")


def test_slurm_jobs_are_described_by_a_file(tmp_path, ctrl_c):
    path = tmp_path / "slurm.yaml"
    path.write_text("jobs: 20\ncores: 4\nmemory: 16GB\nqueue: cpu\naccount: batteries\nwalltime: '02:00:00'\n")
    config = check_cluster(f"slurm:{path}")
    cluster = slurm_cluster(config)
    try:
        script = cluster.job_script()
    finally:
        cluster.close()
    assert signal.getsignal(signal.SIGINT) is ctrl_c
    assert config.jobs == 20
    for line in ("#SBATCH -p cpu", "#SBATCH -A batteries", "#SBATCH --cpus-per-task=4", "#SBATCH -t 02:00:00"):
        assert line in script
    assert "export OMP_NUM_THREADS=1" in script
    assert "--nworkers 4" in script
    assert "--nthreads 1" in script


def test_lines_before_the_workers_stand_in_the_job(ctrl_c):
    cluster = slurm_cluster(SlurmConfig(jobs=1, job_script_prologue=["module load python"]))
    try:
        assert "\nmodule load python\n" in cluster.job_script()
    finally:
        cluster.close()


@pytest.mark.parametrize("key", ["acount", "processes", "memory"])
def test_a_key_that_dask_jobqueue_refuses_is_explained(key, ctrl_c):
    with pytest.raises(BsaError, match=f"dask-jobqueue refuses.*{'many' if key == 'memory' else key}"):
        slurm_cluster(SlurmConfig(jobs=1, **{key: "many"}))


def test_lines_before_the_workers_are_a_list(tmp_path):
    path = tmp_path / "slurm.yaml"
    path.write_text("jobs: 1\njob_script_prologue: module load python")
    with pytest.raises(BsaError, match="job_script_prologue"):
        check_cluster(f"slurm:{path}")


@pytest.mark.parametrize("text", ["cores: 2", "jobs: 0", "jobs: many"])
def test_a_wrong_slurm_file_is_explained(tmp_path, text):
    path = tmp_path / "slurm.yaml"
    path.write_text(text)
    with pytest.raises(BsaError, match="jobs"):
        check_cluster(f"slurm:{path}")
    assert SlurmConfig(jobs=1).cores == 1
