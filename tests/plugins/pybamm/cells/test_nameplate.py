import pytest
from bsa.core.target import CellChange
from bsa.core.task import CellModel
from bsa.plugins.pybamm.cells.nameplate import CAPACITY, labelled, nominal_capacity_ah, widened_cut_offs
from bsa.plugins.pybamm.cells.parameter_sets import load
from bsa.plugins.pybamm.cells.state_of_charge import changed_values

WIDTH, UPPER = "Electrode width [m]", "Upper voltage cut-off [V]"


def test_the_nominal_capacity_goes_with_the_electrode_area() -> None:
    width = float(load("Chen2020")[WIDTH])
    assert nominal_capacity_ah("Chen2020", {}) == 5.0
    assert nominal_capacity_ah("Chen2020", {WIDTH: 2.5 * width}) == pytest.approx(12.5)
    assert nominal_capacity_ah("Chen2020", {WIDTH: 2.5 * width, CAPACITY: 12.0}) == 12.0


def test_a_calibrated_cell_has_its_own_cut_offs_and_the_capacity_of_its_size() -> None:
    wide = {UPPER: 4.4, "Open-circuit voltage at 100% SOC [V]": 4.2}
    cell = CellModel("Chen2020", overrides={WIDTH: 2.0 * float(load("Chen2020")[WIDTH]), **wide})
    assert widened_cut_offs(cell) == {UPPER: 4.4}
    values = labelled(changed_values(cell, CellChange()), cell)
    assert (values[UPPER], values[CAPACITY]) == (4.2, pytest.approx(10.0))


def test_cut_offs_that_a_person_gave_stay() -> None:
    cell = CellModel("Chen2020", overrides={UPPER: 4.1})
    assert labelled(changed_values(cell, CellChange()), cell)[UPPER] == 4.1
