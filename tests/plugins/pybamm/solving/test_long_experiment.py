"""Long records against PyBaMM's own way of running the same cycles."""

from dataclasses import replace

import numpy as np
import pybamm
import pytest
from bsa.core.target import CellChange, Value
from bsa.core.task import CellModel, Experiment
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.plugins.pybamm.modelling.resolution import SEARCH
from bsa.plugins.pybamm.solving.cycle_jumps import TOLERANCE
from bsa.plugins.pybamm.solving.experiment_kinds import compiled, solve_reference
from bsa.plugins.pybamm.solving.long_experiment import LongExperiment

CELL = CellModel("Chen2020", "SPM", {"SEI": "reaction limited"})
CYCLE = ("Charge at 1C until 4.2 V", "Hold at 4.2 V until C/20", "Rest for 5 minutes", "Discharge at 1C until 2.5 V")
COUNT = 60
RATE = "SEI reaction exchange current density [A.m-2]"
FAST = {RATE: 3e-7}
NOTHING = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))


def life(count: int = COUNT, kept: tuple[int, ...] = (1, 30, COUNT)) -> Experiment:
    return Experiment("life", NOTHING, (CYCLE,) * count, detailed_cycles=kept)


@pytest.fixture(scope="module")
def every_cycle() -> tuple[np.ndarray, pybamm.Solution]:
    """Capacities by PyBaMM's own experiment, and its solution."""
    values = pybamm.ParameterValues("Chen2020")
    values.update(FAST)
    experiment = pybamm.Experiment([CYCLE] * COUNT, period="30 seconds")
    simulation = pybamm.Simulation(
        pybamm.lithium_ion.SPM({"SEI": "reaction limited"}),
        experiment=experiment,
        parameter_values=values,
        solver=pybamm.IDAKLUSolver(rtol=SEARCH.rtol, atol=SEARCH.atol),
    )
    solution = simulation.solve(calc_esoh=False, showprogress=False)
    charge = [cycle.steps[3]["Discharge capacity [A.h]"].entries for cycle in solution.cycles]
    return np.array([q[-1] - q[0] for q in charge]), solution


@pytest.mark.slow
def test_the_fade_is_that_of_all_cycles_at_a_fraction_of_them(
    every_cycle: tuple[np.ndarray, pybamm.Solution],
) -> None:
    capacity, solution = every_cycle
    simulated: set[int] = set()
    experiment = LongExperiment(CELL, life(), {RATE: Value(RATE)})
    run = experiment.solve(FAST, lambda step, cycle: simulated.add(cycle))
    assert run.failure is None
    assert run.trajectory is not None
    table = run.trajectory.cycle_table
    assert table is not None
    assert len(simulated) <= COUNT / 3
    np.testing.assert_allclose(table.capacity_ah, capacity, atol=2e-4 * capacity[0])
    assert capacity[0] - capacity[-1] > 0.02 * capacity[0]
    # The curves that are kept are those of PyBaMM too.
    last = run.trajectory.cycle(COUNT)
    theirs = solution.cycles[-1]
    assert last.duration == pytest.approx(theirs.steps[-1].t[-1] - theirs.steps[0].t[0], rel=2e-4)
    assert run.trajectory.cycles == (1, 30, COUNT)


@pytest.mark.slow
def test_only_the_curves_of_chosen_cycles_are_kept() -> None:
    few, many = (
        LongExperiment(CELL, life(count, (1, count)), {RATE: Value(RATE)}).solve(FAST).trajectory for count in (8, 40)
    )
    assert few is not None
    assert many is not None
    assert len(many) == pytest.approx(len(few), rel=0.05)


@pytest.mark.slow
def test_a_reference_simulates_every_cycle() -> None:
    run = solve_reference(CELL, life(12, (1, 12)), CellChange(values=FAST))
    assert run.trajectory is not None
    search = compiled(CELL, life(12, (1, 12)), {RATE: Value(RATE)}).solve(FAST)
    assert search.trajectory is not None
    ours, theirs = search.trajectory.cycle_table, run.trajectory.cycle_table
    assert ours is not None
    assert theirs is not None
    np.testing.assert_allclose(ours.capacity_ah, theirs.capacity_ah, rtol=2e-4)


@pytest.mark.slow
def test_other_cycles_in_between_start_from_where_the_ones_before_ended() -> None:
    check = (*CYCLE[:3], "Discharge at C/2 until 2.5 V")
    protocol = (CYCLE,) * 15 + (check,) + (CYCLE,) * 15
    run = LongExperiment(CELL, replace(life(), protocol=protocol, detailed_cycles=(16, 31)), {}).solve({})
    assert run.trajectory is not None
    table = run.trajectory.cycle_table
    assert table is not None
    assert list(table.cycle) == list(range(1, 32))
    # Half the current draws more, and leaves the fade as it is.
    assert table.capacity_ah[15] > table.capacity_ah[14] > table.capacity_ah[16]
    assert run.trajectory.cycles == (16, 31)
    assert [str(step.label) for step in run.trajectory.cycle(16).steps][-1] == check[-1]


@pytest.mark.slow
def test_where_a_life_ends_is_told_with_what_was_reached() -> None:
    # The discharge must last an hour, which a fading cell cannot.
    protocol = ((*CYCLE[:3], "Discharge at 0.95C for 1 hour"),) * COUNT
    cell = replace(CELL, overrides={RATE: 2e-6})
    run = LongExperiment(cell, replace(life(), protocol=protocol), {}).solve({})
    assert run.failure is not None
    assert "Minimum voltage" in run.failure.cause
    assert 1 < run.failure.cycle < COUNT
    assert run.failure.unfinished
    assert run.trajectory is not None
    assert run.trajectory.cycles[-1] == run.failure.cycle
    assert run.trajectory.cycle_table is not None
    assert run.trajectory.cycle_table.cycle[-1] == run.failure.cycle - 1
    assert run.failure.reached_s > 3000.0 * run.failure.cycle


@pytest.mark.slow
def test_a_candidate_that_cannot_start_is_a_failure_in_a_line() -> None:
    cell = replace(CELL, overrides={"Maximum concentration in negative electrode [mol.m-3]": 1000.0})
    run = LongExperiment(cell, replace(life(), protocol=(CYCLE,) * 4, detailed_cycles=(1,)), {}).solve({})
    assert run.failure is not None
    assert "\n" not in run.failure.cause
    assert run.trajectory is None


def test_the_tolerance_leaves_room_below_what_is_promised() -> None:
    assert 3 * TOLERANCE < 2e-4


@pytest.mark.slow
def test_what_was_lost_is_told_for_every_cycle() -> None:
    table = solve_reference(CELL, life(6, (1, 6)), CellChange(values=FAST)).trajectory.cycle_table  # type: ignore[union-attr]
    assert table is not None
    assert np.all(np.diff(table.lithium_lost_pct) > 0)
    np.testing.assert_allclose(table.negative_material_lost_pct, 0.0, atol=1e-9)


@pytest.mark.slow
def test_a_resistance_is_read_as_long_after_the_switch_as_the_measured_one() -> None:
    cell = CellModel("Mohtat2020", "SPM")
    kinds = (Step(StepKind.REST, 0, 2), Step(StepKind.CC_DISCHARGE, 2, 4))
    current = np.array([0.0, 0.0, 5.0, 5.0])
    prompt, late = (
        Trajectory(np.array([0.0, 300.0, first, 900.0]), current, np.full(4, 3.9), None, kinds)
        for first in (300.0, 301.0)
    )
    experiment = replace(life(3, (1, 3)), initial_soc=0.5)
    runs = [LongExperiment(cell, replace(experiment, target=one), {}).solve({}) for one in (prompt, late)]
    assert all(run.trajectory is not None and run.trajectory.cycle_table is not None for run in runs)
    (at_switch, later), tables = [run.trajectory for run in runs], [run.trajectory.cycle_table for run in runs]
    # Else both are the same.
    np.testing.assert_array_equal(later.voltage, at_switch.voltage)
    np.testing.assert_array_equal(tables[1].capacity_ah, tables[0].capacity_ah)
    short = replace(experiment, target=prompt, protocol=((*CYCLE[:3], "Discharge at 1C for 1 second"),))
    second = LongExperiment(cell, replace(short, detailed_cycles=(1,)), {}).solve({}).trajectory
    drop = second.voltage[second.steps[-1].start - 1] - second.voltage[-1]
    assert tables[1].resistance_ohm[0] == pytest.approx(drop / second.current[-1], rel=1e-3)
    assert tables[1].resistance_ohm[0] > 1.03 * tables[0].resistance_ohm[0]


@pytest.mark.slow
def test_a_hold_that_ends_at_a_current_leads_on_to_the_next_step() -> None:
    cycle = ("Charge at 1 A until 4.2 V", "Hold at 4.2 V until 50 mA", "Rest for 5 minutes", CYCLE[3])
    run = LongExperiment(CELL, replace(life(), protocol=(cycle,) * 3, detailed_cycles=(3,)), {}).solve({})
    assert run.failure is None
    assert run.trajectory is not None
    assert len(run.trajectory.steps) == 4
