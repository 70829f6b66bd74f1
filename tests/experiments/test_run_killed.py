"""A run killed at any moment goes on where it stopped, to the same result."""

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from bsa.core.run.journal import read_events
from bsa.experiments.tasks.find import PACKAGED

TASK = f"""
name: short
parameter_set: Chen2020
model: SPM
search:
  "Negative particle radius [m]": {{factors: [0.5, 2]}}
  "Positive electrode thickness [m]": {{factors: [0.7, 1.5]}}
experiments:
  - data: {PACKAGED / "demo.csv"}
    initial_soc: 0.05
"""
GRID = """
name: short
tasks: [task.yaml]
scaffolds: [full]
seeds: [1, 2]
rounds: 6
warm_up: 5
simulations: 10
"""
COMMAND = [sys.executable, "-c", "from bsa.experiments.cli.main import run_main; run_main()"]
SETTINGS = ["--scaffold", "full", "--warmup", "5", "--rounds", "6", "--simulations", "10", "--workers", "2"]


def command(folder: Path, *arguments: str) -> list[str]:
    return [*COMMAND, str(folder / "task.yaml"), *SETTINGS, *arguments]


def trials(folder: Path) -> list[tuple[int, dict[str, float], float | None]]:
    found = [event for event in read_events(folder) if event["event"] == "trial"]
    return sorted(
        (event["index"], event["candidate"], event["metrics"] and event["metrics"]["objective"]) for event in found
    )


def written(folder: Path) -> int:
    return len(trials(folder)) if (folder / "journal.jsonl").exists() else 0


def below(process: int) -> set[int]:
    """The processes started by this one, and by those, as far as they still run."""
    table = subprocess.run(["ps", "-eo", "pid=,ppid=,stat="], capture_output=True, text=True, check=True).stdout
    parents = {int(pid): int(ppid) for pid, ppid, state in map(str.split, table.splitlines()) if state[0] != "Z"}
    found, more = set[int](), {process}
    while more:
        more = {pid for pid, parent in parents.items() if parent in more}
        found |= more
    return found


def running(processes: set[int]) -> set[int]:
    """Those that still run; one that was killed and waits to be noticed has no command line."""
    return {pid for pid in processes if Path(f"/proc/{pid}").exists() and Path(f"/proc/{pid}/cmdline").read_bytes()}


def kill(process: subprocess.Popen[bytes]) -> None:
    """Kill it; the processes that it started, where they can be looked up, end within seconds."""
    started = below(process.pid) if sys.platform == "linux" else set[int]()
    process.send_signal(signal.SIGKILL)
    process.wait()
    ended = time.monotonic() + 10
    while left := running(started):
        assert time.monotonic() < ended, left
        time.sleep(0.1)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="looks processes up in /proc")
def test_simulators_end_with_a_killed_grid(tmp_path: Path) -> None:
    (tmp_path / "task.yaml").write_text(TASK)
    (tmp_path / "grid.yaml").write_text(GRID)
    grid = [*COMMAND[:-1], "from bsa.experiments.cli.main import main; main()", "grid", str(tmp_path / "grid.yaml")]
    start = [*grid, "--store", str(tmp_path / "store"), "--workers", "2"]
    process = subprocess.Popen(start, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        while not any(written(folder) for folder in tmp_path.glob("store/cells/*")):
            assert process.poll() is None
            time.sleep(0.05)
        assert len(below(process.pid)) >= 2
    finally:
        kill(process)


@pytest.mark.slow
def test_a_run_killed_at_random_moments_ends_like_an_uninterrupted_one(tmp_path: Path) -> None:
    """Its simulators end with it each time."""
    (tmp_path / "task.yaml").write_text(TASK)
    whole = subprocess.run(
        command(tmp_path, "--out", str(tmp_path / "whole")), capture_output=True, text=True, check=False
    )
    assert whole.returncode == 0, whole.stderr
    # Moments are counted in trials, not in seconds: how fast a run is depends on what else the machine does.
    rng = random.Random(20)
    killed = tmp_path / "killed"
    arguments = ["--out", str(killed)]
    kills = 0
    for wanted in sorted(rng.sample(range(1, len(trials(tmp_path / "whole")) - 1), 2)):
        process = subprocess.Popen(command(tmp_path, *arguments), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while process.poll() is None and written(killed) < wanted:
            time.sleep(0.02)
        if arguments[0] == "--out" and sys.platform == "linux":
            assert len(below(process.pid)) >= 2
        time.sleep(rng.uniform(0.0, 0.3))
        kills += process.poll() is None
        kill(process)
        arguments = ["--resume", str(killed)]
    assert kills > 0
    last = subprocess.run([*COMMAND, "--resume", str(killed)], capture_output=True, text=True, check=False)
    assert last.returncode == 0, last.stderr
    assert trials(killed) == trials(tmp_path / "whole")
    results = [json.loads((folder / "result.json").read_text()) for folder in (killed, tmp_path / "whole")]
    for key in ("status", "initial", "best", "simulations", "llm_calls"):
        assert results[0][key] == results[1][key]


@pytest.mark.slow
@pytest.mark.usefixtures("ctrl_c")
def test_an_interrupt_is_said_and_can_be_resumed(tmp_path: Path) -> None:
    (tmp_path / "task.yaml").write_text(TASK)
    process = subprocess.Popen(
        command(tmp_path, "--out", str(tmp_path / "run")), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while not written(tmp_path / "run"):
        assert process.poll() is None
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"bsa-run --resume {tmp_path / 'run'}" in said
    assert "Traceback" not in said
    assert (tmp_path / "run" / "report.html").exists()
