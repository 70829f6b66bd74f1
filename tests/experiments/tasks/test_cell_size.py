"""The size of the measured cell by the charge that its records pass."""

import numpy as np
import pytest
from bsa.core.record import Record
from bsa.core.segmentation import segment
from bsa.core.task import CellModel
from bsa.core.trajectory import Trajectory
from bsa.experiments.tasks.cell_size import size_factor, starting_soc
from bsa.experiments.tasks.record_request import RecordRequest
from bsa.plugins.pybamm.cells.parameter_sets import load

CHEN = CellModel("Chen2020", "SPM")
HOLDS_AH = 5.15
"""What the cell of Chen2020 holds."""


def record(first_v: float, last_v: float, charge_ah: float, rest_s: float = 600.0) -> Record:
    """A rest at the first voltage, and a charge (negative) or discharge to the last one in an hour."""
    rest, load_s = np.linspace(0.0, rest_s, 30), rest_s + np.linspace(0.01, 3600.0, 200)
    time = np.concatenate([rest, load_s]) if rest_s else load_s
    current = np.where(time <= rest_s, 0.0, charge_ah) if rest_s else np.full(len(load_s), charge_ah)
    ramp = np.linspace(first_v, last_v, 200)
    voltage = np.concatenate([np.full(30, first_v), ramp]) if rest_s else ramp
    return Record("r", segment(Trajectory(time, current, voltage)))


def factor_of(one: Record, set_name: str = "Chen2020", holds_ah: float = HOLDS_AH) -> tuple[float, str]:
    cell = CellModel(set_name, "SPM")
    start = starting_soc(cell, RecordRequest(one), one)
    return size_factor([one], load(set_name), holds_ah, [start])


def test_a_cell_that_starts_part_full_holds_more_than_it_gives() -> None:
    start = starting_soc(CHEN, RecordRequest(record(4.096, 2.5, 46.0)), record(4.096, 2.5, 46.0))
    assert start == pytest.approx(0.898, abs=0.002)
    factor, said = factor_of(record(4.096, 2.5, 10.0 * HOLDS_AH * 0.898))
    assert factor == pytest.approx(10.0, rel=0.005)
    assert "The records hold 51.6 A.h (46.2 A.h pass from a state of charge of 0.897 on)" in said
    assert "mA" not in said
    # What is missing of the charge may be all that makes it look like a smaller cell.
    assert factor_of(record(3.95, 2.5, 0.65 * HOLDS_AH)) == (1.0, "")


def test_a_full_and_an_empty_cell_hold_what_they_give_and_take() -> None:
    factor, said = factor_of(record(4.2, 2.5, 20.0))
    assert factor == pytest.approx(20.0 / HOLDS_AH, rel=1e-3)
    assert "The records hold 20 A.h, the parameter set's cell" in said
    factor, _ = factor_of(record(2.9, 4.2, -20.0))
    assert factor == pytest.approx(20.0 / HOLDS_AH / 0.98, rel=0.01)


def test_a_start_that_the_first_voltage_does_not_tell_changes_nothing() -> None:
    flat = record(3.28, 2.1, 10.0)  # the plateau of LiFePO4
    assert starting_soc(CellModel("Prada2013", "SPM"), RecordRequest(flat), flat) is None
    loaded = record(3.9, 2.5, 20.0, rest_s=0.0)
    assert starting_soc(CHEN, RecordRequest(loaded), loaded) is None
    assert starting_soc(CHEN, RecordRequest(loaded, initial_soc=0.8), loaded) == 0.8
    assert factor_of(loaded)[0] == pytest.approx(20.0 / HOLDS_AH, rel=1e-3)


def test_a_cell_a_hundred_times_larger_is_asked_for_its_unit() -> None:
    factor, said = factor_of(record(4.2, 2.5, 120.0 * HOLDS_AH))
    assert factor == pytest.approx(120.0, rel=1e-3)
    assert said.endswith("Is the current in mA? Then say --unit current=mA.")


def test_a_large_charge_is_written_out() -> None:
    _, said = factor_of(record(4.2, 2.5, 4567.0))
    assert "The records hold 4,570 A.h" in said


def test_a_usual_cell_is_not_asked_for_its_unit_where_the_set_is_of_a_tiny_one() -> None:
    """Marquis2019 holds 0.12 A.h: a pouch cell of 13 A.h is more than a hundred times as large."""
    factor, said = factor_of(record(4.2, 2.5, 13.0), holds_ah=0.123)
    assert factor > 100.0
    assert "starts from" in said
    assert "mA" not in said


def test_a_cell_that_gives_a_little_more_than_the_set_holds_is_larger_and_one_that_gives_a_little_less_is_not() -> None:
    assert factor_of(record(4.2, 2.5, 0.9 * HOLDS_AH)) == (1.0, "")
    assert factor_of(record(4.2, 2.5, 1.01 * HOLDS_AH)) == (1.0, "")
    factor, said = factor_of(record(4.2, 2.5, 1.05 * HOLDS_AH))
    assert factor == pytest.approx(1.05, rel=1e-3)
    assert "--no-scale keeps it" in said
