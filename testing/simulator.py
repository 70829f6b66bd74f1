"""What a simulator promises."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
import pytest

from ..core.comparison.overlap import overlap_rms
from ..core.comparison.residuals import residuals
from ..core.parameters import Candidate
from ..core.run.run_plugins import RunPlugins
from ..core.simulation import Outcome, in_order
from ..core.task import Task
from ..core.task_reduction import TaskReduction
from ..core.trajectory import FloatArray
from .run_plugin import RunPluginConformance
from .sample_task import sample_task

_SAME = 1e-6
"""Relative difference of two solutions of one candidate; a solver with a tolerance of its own need not repeat bits."""

_UNIT_FACTOR = 100.0
"""A simulated signal whose largest value is this many times the record's, or a part of it, is in another unit."""


class SimulatorConformance(RunPluginConformance):
    """Tests of a simulator.

    A subclass gives the fixture ``name`` and, if the simulator cannot simulate the sample task (a cell of Chen2020
    driven by its current), the fixture ``task``.
    """

    kind = "simulator"
    part: ClassVar[str] = "simulator"

    @pytest.fixture
    def task(self, name: str) -> Task:
        """What is simulated."""
        return sample_task(name)

    @pytest.fixture
    def candidates(self, task: Task) -> list[Candidate]:
        """The initial candidate and two more inside the bounds."""
        rng = np.random.default_rng(1)
        return [task.space.initial, *(task.space.sample(rng) for _ in range(2))]

    @pytest.fixture
    def outcomes(self, plugins: RunPlugins, candidates: list[Candidate]) -> list[Outcome]:
        """What the simulator makes of the candidates."""
        return simulated(plugins, candidates)

    def test_the_initial_candidate_is_simulated_to_its_end(self, outcomes: list[Outcome]) -> None:
        """A search needs a start."""
        assert outcomes[0].failure is None

    def test_a_candidate_has_one_outcome_wherever_it_stands(
        self, plugins: RunPlugins, candidates: list[Candidate], outcomes: list[Outcome]
    ) -> None:
        """An outcome follows from its candidate alone: not from the place, nor from what was simulated before."""
        for first, second in zip(outcomes, simulated(plugins, candidates[::-1])[::-1], strict=True):
            for one, other in zip(first.runs, second.runs, strict=True):
                assert (one.trajectory is None) == (other.trajectory is None)
                if one.trajectory is not None and other.trajectory is not None:
                    assert one.trajectory.time == pytest.approx(other.trajectory.time, rel=_SAME)
                    for signal, values in one.trajectory.signals.items():
                        assert values == pytest.approx(other.trajectory.values(signal), rel=_SAME, abs=_SAME)

    def test_signals_have_the_units_of_the_record(self, task: Task, outcomes: list[Outcome]) -> None:
        """Simulated values are of the size of the measured ones: V and not mV, s and not h."""
        for experiment, run in zip(task.experiments, outcomes[0].runs, strict=True):
            assert run.trajectory is not None
            pairs = {"time": (run.trajectory.time, experiment.target.time)}
            for signal in (*task.driven, *task.observed_in(experiment.target)):
                pairs[signal.name] = run.trajectory.values(signal.name), experiment.target.values(signal.name)
            for name, (ours, theirs) in pairs.items():
                assert 1 / _UNIT_FACTOR < (_size(ours) or 1.0) / (_size(theirs) or 1.0) < _UNIT_FACTOR, name

    def test_a_measured_drive_is_followed(self, task: Task, outcomes: list[Outcome]) -> None:
        """Without a protocol the measured driven signals drive the simulation, with their sign."""
        for experiment, run in zip(task.experiments, outcomes[0].runs, strict=True):
            if experiment.protocol is None and run.trajectory is not None:
                for signal in task.driven:
                    off = overlap_rms(run.trajectory, experiment.target, signal.name, driven=True)
                    assert off <= 0.1 * _size(experiment.target.values(signal.name)), signal.name

    def test_the_corners_of_the_space_have_outcomes(self, plugins: RunPlugins, task: Task) -> None:
        """A simulation that fails is an outcome with its cause, never an exception."""
        corners = [task.space.from_unit(np.full(len(task.space), position)) for position in (0.0, 1.0)]
        for outcome in simulated(plugins, corners):
            assert outcome.failure is None or outcome.failure.cause

    def test_reference_accuracy(self, plugins: RunPlugins, task: Task) -> None:
        """``exact`` changes how a candidate is solved, not what is answered."""
        assert simulated(plugins, [task.space.initial], exact=True)[0].failure is None

    def test_other_experiments_are_simulated_where_it_can(self, plugins: RunPlugins, task: Task) -> None:
        """``simulate_variant`` answers as ``simulate`` does."""
        found = plugins.simulate_variant([task.space.initial], task.experiments)
        assert found is None or [place for place, _ in found] == [0]

    def test_a_cell_at_equilibrium_has_the_samples_of_its_record(self, plugins: RunPlugins, task: Task) -> None:
        """``equilibrium`` answers as ``simulate`` does, at the record's own samples."""
        for outcome in plugins.equilibrium([task.space.initial]) or []:
            for experiment, run in zip(task.experiments, outcome.runs, strict=True):
                assert run.trajectory is not None
                assert len(run.trajectory) == len(experiment.target)

    def test_a_low_fidelity_model_has_the_residuals_of_the_task(
        self, plugins: RunPlugins, task: Task, candidates: list[Candidate]
    ) -> None:
        """``simulate_low_fidelity`` answers as ``simulate`` does; with no candidates, whether there is such a model."""
        if plugins.simulate_low_fidelity([]) is None:
            return
        found = plugins.simulate_low_fidelity(candidates)
        assert found is not None
        ours, full = in_order(found)[0], simulated(plugins, candidates[:1])[0]
        one, other = residuals(task, ours), residuals(task, full)
        assert one is not None
        assert other is not None
        assert one.shape == other.shape

    def test_the_same_reduction_is_the_same_object(self, plugins: RunPlugins) -> None:
        """What was compiled for a reduced task is kept under its identity."""
        assert plugins.reduce_task(TaskReduction(0.5)) is plugins.reduce_task(TaskReduction(0.5))

    def test_what_it_offers_beside_simulating_can_be_used(self, plugins: RunPlugins, task: Task) -> None:
        """Protocols to run next are steps by name; exported files are texts under plain names, Python that compiles."""
        assert all(cycles for cycles in plugins.next_protocols().values())
        for name, content in plugins.export(task.space.initial).items():
            if name.endswith(".py"):
                compile(content, name, "exec")


def simulated(plugins: RunPlugins, candidates: Sequence[Candidate], exact: bool = False) -> list[Outcome]:
    """The outcomes in the order of their candidates."""
    return in_order(plugins.simulate(candidates, exact))


def _size(values: FloatArray) -> float:
    return float(np.max(np.abs(values)))
