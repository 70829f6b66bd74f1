"""Where fitted records start."""

import numpy as np
import pytest
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.target import INITIAL_SOC, InitialSoc, InitialVoltage, initial_voltage_name, soc_name
from bsa.core.task import Experiment
from bsa.core.trajectory import Trajectory
from bsa.experiments.tasks.initial_states import KnownStart, with_searched_starts

WIDTH = Parameter("Electrode width [m]", 1.0, 0.5, 2.0)
CORRECTION = Parameter(initial_voltage_name(), 0.0, -0.1, 0.1, target=InitialVoltage(), deviation=0.02, prior=True)
STATE = Parameter(INITIAL_SOC, 0.5, 0.0, 1.0, target=InitialSoc(), deviation=0.05, prior=True)
NOTHING = Trajectory(np.zeros(2), np.zeros(2), np.zeros(2))


def started(*starts: KnownStart | None, space: tuple[Parameter, ...] = (WIDTH, CORRECTION, STATE), given: bool = False):  # type: ignore[no-untyped-def]
    experiments = [
        Experiment(f"r{place}", NOTHING, initial_soc=None if start is None else start.soc)
        for place, start in enumerate(starts)
    ]
    found, begun = with_searched_starts(ParameterSpace(space), experiments, starts, given, len(starts) == 1)
    return {p.name: p for p in found if p is not WIDTH}, begun


def test_records_of_alike_rest_voltages_share_one_correction() -> None:
    searched, begun = started(KnownStart(0.99, 4.183), KnownStart(0.98, 4.175), KnownStart(0.03, 3.2))
    full, empty = "Initial voltage correction at 4.18 V [V]", "Initial voltage correction at 3.20 V [V]"
    assert set(searched) == {full, empty}
    assert searched[full].target == InitialVoltage(4.18)
    assert searched[full].deviation == CORRECTION.deviation
    assert [one.initial_voltage for one in begun] == [4.183, 4.175, 3.2]
    assert all(one.initial_soc is None for one in begun)


def test_records_that_begin_under_load_have_a_state_of_charge_each() -> None:
    searched, begun = started(KnownStart(0.99, 4.18), KnownStart(0.9), KnownStart(0.4))
    assert set(searched) == {"Initial voltage correction at 4.18 V [V]", soc_name("r1"), soc_name("r2")}
    assert (searched[soc_name("r1")].initial, searched[soc_name("r2")].initial) == (0.9, 0.4)
    assert [one.initial_soc for one in begun] == [None, 0.9, 0.4]


def test_one_record_alone_has_a_state_of_charge_without_its_name() -> None:
    assert {name: p.initial for name, p in started(KnownStart(0.9))[0].items()} == {INITIAL_SOC: 0.9}
    assert started(KnownStart(0.9), given=True)[0][INITIAL_SOC].initial == STATE.initial


def test_a_search_of_ones_own_has_the_state_of_charge_that_it_names() -> None:
    searched, begun = started(KnownStart(0.99, 4.18), space=(WIDTH, STATE))
    assert set(searched) == {INITIAL_SOC}
    assert begun[0].initial_soc == 0.99
    assert begun[0].initial_voltage is None
    searched, begun = started(KnownStart(0.99, 4.18), space=(WIDTH,))
    assert not searched
    assert begun[0].initial_soc == 0.99


def test_a_correction_that_a_person_names_is_the_one_that_is_searched() -> None:
    name = "Initial voltage correction at 4.18 V [V]"
    own = Parameter(name, 0.0, -0.05, 0.05, target=InitialVoltage(4.18))
    searched, begun = started(KnownStart(0.99, 4.18), KnownStart(0.5, 3.7), space=(WIDTH, own))
    assert searched == {name: own}
    assert [one.initial_voltage for one in begun] == [4.18, 3.7]


@pytest.mark.parametrize(("soc_per_v", "by_voltage"), [(2.4, True), (2.6, False)])
def test_a_flat_open_circuit_curve_leaves_the_state_of_charge_to_be_searched(
    soc_per_v: float, by_voltage: bool
) -> None:
    searched, begun = started(KnownStart(0.9, 3.33, soc_per_v), KnownStart(0.4))
    assert ("Initial voltage correction at 3.33 V [V]" in searched) == by_voltage
    assert (soc_name("r0") in searched) == (not by_voltage)
    assert (begun[0].initial_voltage, begun[0].initial_soc) == ((3.33, None) if by_voltage else (None, 0.9))


def test_where_nothing_is_known_of_a_start_its_state_of_charge_is_searched() -> None:
    searched, begun = started(None)
    assert searched == {INITIAL_SOC: STATE}
    assert begun[0].initial_soc is None
    assert not started()[0]  # spectra alone start where the cell has their voltage


@pytest.mark.parametrize("gap_v", [0.049, 0.051])
def test_groups_end_where_rest_voltages_are_no_longer_alike(gap_v: float) -> None:
    searched, _ = started(KnownStart(0.9, 4.0), KnownStart(0.95, 4.0 + gap_v))
    assert len(searched) == (1 if gap_v < 0.05 else 2)
