"""Fixtures that several folders share."""

from __future__ import annotations

import itertools
import os
import signal
import textwrap
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.contracts.registry import installed
from bsa.core.messages import Backend
from bsa.core.run import recording
from bsa.core.run.listener import SILENT, Listener
from bsa.core.run.loop import RunResult
from bsa.core.run.run_config import RunConfig
from bsa.core.scaffold import Scaffold
from bsa.core.task import Task
from bsa_toy_cell import toy_scaffold, toy_task
from hypothesis import settings

RunToy = Callable[..., RunResult]
Install = Callable[..., Path]

_module_numbers = itertools.count()

# Compiling in the background would take a core from the tests beside it; `test_machine_code.py` has its own.
os.environ.setdefault("BSA_COMPILER", "")

# How long an example takes says how busy the machine is.
settings.register_profile("any machine", deadline=None)
settings.load_profile("any machine")


@pytest.fixture(autouse=True)
def _no_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lost calls are made again at once."""
    monkeypatch.setattr(recording, "ASK_AGAIN_AFTER_S", (0.0,) * len(recording.ASK_AGAIN_AFTER_S))


@pytest.fixture
def without_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    """BoTorch computes in Python: a first acquisition of several objectives would compile C++ for a minute."""
    module = pytest.importorskip("botorch.acquisition.multi_objective.logei")
    monkeypatch.setattr(module, "_load_attempted", True)


@pytest.fixture
def few_draws(without_compiler: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Acquisitions of few draws and starts, for tests of what holds wherever an acquisition has its maximum."""
    constructors = pytest.importorskip("botorch.acquisition.input_constructors")
    optimizer = pytest.importorskip("ax.generators.torch.botorch_modular.optimizer_argparse")
    sampler = constructors._get_sampler
    monkeypatch.setattr(constructors, "_get_sampler", lambda mc_samples, qmc: sampler(8, qmc))
    monkeypatch.setattr(optimizer, "NUM_RESTARTS", 2)
    monkeypatch.setattr(optimizer, "RAW_SAMPLES", 64)


@pytest.fixture
def ctrl_c() -> Iterator[Any]:
    """Ctrl-C does here, and in processes started here, what it does at a terminal: a background job ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield signal.default_int_handler
    signal.signal(signal.SIGINT, before)


class HerePool:
    """A pool without processes: each would import PyBaMM for seconds, and processes have tests of their own."""

    def __init__(
        self, service: Any, size: int, time_limit_s: float, watch: Callable[[list[Any]], None] = lambda reports: None
    ) -> None:
        self._service, self._watch = service, watch
        self._prepared = False
        self._lock = threading.Lock()  # A process has one job at a time.

    def run(self, jobs: Sequence[Any], allowance: float = 1.0) -> Iterator[tuple[int, Any]]:
        for place, job in enumerate(jobs):
            with self._lock:
                if not self._prepared:
                    self._service.prepare()
                    self._prepared = True
                found = self._service.work(job, lambda report: self._watch([report]))
            yield place, found

    def close(self) -> None:
        pass


@pytest.fixture(scope="module")
def simulated_here() -> Iterator[None]:
    """PyBaMM's simulations are made in this process."""
    from bsa.plugins.pybamm.simulators import request_pool, worker

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(worker, "Pool", HerePool)
        patch.setattr(request_pool, "Pool", HerePool)
        yield


@pytest.fixture
def run_toy(tmp_path: Path) -> RunToy:
    """Runs the toy task in a folder and gives the result."""
    from bsa.experiments.run import execute_run

    def run(
        folder: Path | None = None,
        scaffold: Scaffold | None = None,
        backend: Backend | None = None,
        task: Task | None = None,
        analysing: bool = False,
        rebudgeted: bool = False,
        listener: Listener = SILENT,
        **config: Any,
    ) -> RunResult:
        settings = {"rounds": 12, "warm_up": 8, "simulations": 30, **config}
        return execute_run(
            task or toy_task(),
            RunConfig(scaffold=scaffold or toy_scaffold(), **settings),
            folder or tmp_path / "run",
            backend or RulesBackend(),
            analysing=analysing,
            rebudgeted=rebudgeted,
            listener=listener,
        )

    return run


@pytest.fixture
def stranger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Installs distributions of strangers into a folder of the path, as pip would; gives the folder."""
    folder = tmp_path / "site-packages"

    def install(code: str, name: str = "zz-fault", version: str = "0.1") -> Path:
        module = f"zz_module_{next(_module_numbers)}"
        about = folder / f"{name.replace('-', '_')}-{version}.dist-info"
        about.mkdir(parents=True)
        (folder / f"{module}.py").write_text(textwrap.dedent(code))
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
        (about / "entry_points.txt").write_text(f"[bsa]\n{name} = {module}\n")
        monkeypatch.syspath_prepend(str(folder))
        installed.cache_clear()
        return folder

    yield install
    installed.cache_clear()
