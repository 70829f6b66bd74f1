import multiprocessing
import signal
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.simulation import Outcome
from bsa.core.target import target_named
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import Trajectory
from bsa.plugins.pybamm.modelling.resolution import FINE, REFERENCE, SEARCH
from bsa.plugins.pybamm.simulators import processes
from bsa.plugins.pybamm.simulators.worker import CandidateService, WorkerPool

pytestmark = pytest.mark.slow

NAME = "Negative particle radius [m]"
NOTHING = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
CELL = CellModel("Chen2020", "SPM")


def service(*steps: str, searched: tuple[str, ...] = (NAME,)) -> CandidateService:
    return CandidateService(
        CELL, (Experiment("x", NOTHING, (steps,), initial_soc=0.5),), {key: target_named(key) for key in searched}
    )


@pytest.fixture(scope="module")
def pool() -> Iterator[WorkerPool]:
    pool = WorkerPool(service("Discharge at 1C for 1 minute"), 2, 30.0)
    yield pool
    pool.close()


def simulate(pool: WorkerPool, *radii: float, exact: bool = False) -> list[Outcome]:
    outcomes = dict(pool.simulate([{NAME: radius} for radius in radii], REFERENCE if exact else SEARCH))
    return [outcomes[place] for place in range(len(radii))]


def test_every_candidate_is_answered_at_its_place(pool: WorkerPool) -> None:
    outcomes = simulate(pool, 4e-6, 5e-6, 6e-6, 7e-6)
    assert all(outcome.ok for outcome in outcomes)
    ends = [outcome.runs[0].trajectory.voltage[-1] for outcome in outcomes if outcome.runs[0].trajectory]
    assert ends == sorted(ends, reverse=True)


def test_the_reference_agrees_with_the_search(pool: WorkerPool) -> None:
    (search,) = simulate(pool, 5e-6)
    (exact,) = simulate(pool, 5e-6, exact=True)
    a, b = search.runs[0].trajectory, exact.runs[0].trajectory
    assert a is not None
    assert b is not None
    assert a.voltage[-1] == pytest.approx(b.voltage[-1], abs=1e-4)


def test_a_finer_mesh_moves_the_voltage_by_some_millivolts_at_most(pool: WorkerPool) -> None:
    (exact,) = simulate(pool, 5e-6, exact=True)
    ((_, finer),) = pool.simulate([{NAME: 5e-6}], FINE)
    a, b = exact.runs[0].trajectory, finer.runs[0].trajectory
    assert a is not None
    assert b is not None
    assert 1e-6 < abs(a.voltage[-1] - b.voltage[-1]) < 5e-3


def test_a_killed_worker_costs_one_trial(pool: WorkerPool) -> None:
    simulate(pool, 5e-6)
    victim = pool.processes.workers[0]
    victim._process.kill()
    outcomes = simulate(pool, 5e-6, 5e-6, 5e-6)
    failures = [outcome for outcome in outcomes if not outcome.ok]
    assert len(failures) == 1
    assert failures[0].failure is not None
    assert "process died" in failures[0].failure.cause
    assert all(outcome.ok for outcome in simulate(pool, 5e-6, 5e-6))


def test_a_hang_is_stopped_at_the_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "START_LIMIT_S", 0.2)
    pool = WorkerPool(service("Discharge at 1C for 1 minute"), 1, 0.1)
    try:
        (outcome,) = simulate(pool, 5e-6)
        assert outcome.failure is not None
        assert "time limit of 0.1 s" in outcome.failure.cause
    finally:
        pool.close()


def test_a_task_that_cannot_be_built_is_the_users_error() -> None:
    pool = WorkerPool(service("Discharge at 1C for 1 minute", searched=("Nonsense [m]",)), 1, 30.0)
    try:
        with pytest.raises(BsaError, match="PyBaMM cannot build the model"):
            list(pool.simulate([{"Nonsense [m]": 1.0}]))
    finally:
        pool.close()


def test_workers_that_nobody_waits_for_are_ended(pool: WorkerPool) -> None:
    answers = pool.simulate([{NAME: 4e-6}, {NAME: 9e-6}, {NAME: 9e-6}])
    next(answers)
    answers.close()
    ends = [outcome.runs[0].trajectory.voltage[-1] for outcome in simulate(pool, *[4e-6] * 4)]  # type: ignore[union-attr]
    assert ends == pytest.approx([ends[0]] * 4, abs=1e-9)


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_while_a_worker_starts_leaves_none_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    @contextmanager
    def pressed() -> Iterator[None]:
        signal.raise_signal(signal.SIGINT)
        yield

    monkeypatch.setattr(processes, "one_thread_for_children", pressed)
    pool, before = (
        WorkerPool(service("Discharge at 1C for 1 minute"), 1, 30.0),
        set(multiprocessing.active_children()),
    )
    with pytest.raises(KeyboardInterrupt):
        simulate(pool, 5e-6)
    assert set(multiprocessing.active_children()) == before


def test_the_cycle_of_a_life_is_told_as_it_goes_on_whatever_the_accuracy() -> None:
    cycle = ("Discharge at 1C for 1 minute", "Charge at 1C for 1 minute")
    life = Experiment("x", NOTHING, (cycle,) * 3, initial_soc=0.5, detailed_cycles=(1, 3))
    told: list[tuple[int, int]] = []
    pool = WorkerPool(CandidateService(CELL, (life,), {NAME: target_named(NAME)}), 1, 30.0, lambda *at: told.append(at))
    for exact in (False, True):
        simulate(pool, 5e-6, exact=exact)
        assert told == [(1, 3), (2, 3), (3, 3)]
        told.clear()
    pool.close()
