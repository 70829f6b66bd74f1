"""Every measured file beside the project is read and cut as its cycler ran it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.reading import read_record
from bsa.core.record import ReadOptions
from bsa.core.trajectory import StepKind

DATA = Path(__file__).parents[3] / ".." / "shared" / "data"

pytestmark = [
    pytest.mark.real_data,
    pytest.mark.skipif(not DATA.is_dir(), reason="the measured cells of ../shared/data are not here"),
]

R, CC, CV, D, DR, P = (
    *(StepKind.REST, StepKind.CC_CHARGE, StepKind.CV_HOLD),
    *(StepKind.CC_DISCHARGE, StepKind.DRIVE, StepKind.PULSE),
)
CALCE = [R, CC, R, CV, R, D, R]
RATE = [R, CC, CV, R, D, R]
FULL = [R, CV, R, D, R]

FILES = {
    "aboutenergy/NMC_25degC_1C.csv": ({}, [R, D], 12.94),
    "aboutenergy/NMC_25degC_2C.csv": ({}, [R, D], 12.80),
    "aboutenergy/NMC_25degC_Co2.csv": ({}, [R, D], 13.02),
    "aboutenergy/NMC_25degC_Co20.csv": ({}, [R, D], 13.1),
    "aboutenergy/NMC_25degC_DriveCycle.csv": ({}, [R, DR], None),
    "calce_cs2/CS2_35_8_17_10.xlsx": ({}, CALCE, 1.1385),
    "calce_cs2/CS2_36_8_17_10.xlsx": ({}, CALCE, 1.1448),
    "lgm50/Cell783_0p1C_25degC.csv": ({}, [*FULL, CC, CV, R, D, R], 4.944),
    "lgm50/Cell785_0p5C_0degC.csv": ({}, [*RATE, *RATE[1:]], 4.293),
    "lgm50/Cell785_0p5C_10degC.csv": ({}, [*RATE, *RATE[1:]], 4.520),
    "lgm50/Cell785_0p5C_25degC.csv": ({}, [*FULL, CC, CV, R, D, R], 4.842),
    "lgm50/Cell796_2C_25degC.csv": ({}, FULL, 4.826),
    "nasa_pcoe/B0005_discharges.csv.gz": ({"where": {"test_id": "1"}}, [R, D, R], 1.8565),
    "nasa_pcoe/B0005_charges_every20th.csv.gz": ({"where": {"test_id": "2"}}, [R, CC, CV, R], None),
    "panasonic_18650pf/03-09-17_17.59 3349_Dis1C_1.mat": ({}, [D, R], 2.802),
    "panasonic_18650pf/03-09-17_19.03 3349_Charge2.mat": ({}, [R, CC, CV, R], None),
    "panasonic_18650pf/03-20-17_01.43 25degC_US06_Pan18650PF.mat": ({}, [R, DR, R], None),
    "panasonic_18650pf/05-08-17_13.26 C20 OCV Test_C20_25dC.mat": ({}, [R, D, R, CC, R], 2.995),
    "lgm50/LGM50_5Ah_RateTest.mat": ({"sheet": "T25/cRate_2C"}, [R, D, R, CC, CV, R], 4.82),
    "lgm50/LGM50_5Ah_Pulse.mat": ({"sheet": "T25/SoC5/Cell3"}, [R, P, R], None),
    "enertech/1C_discharge_U.txt": (
        {"columns": {"time": "1", "voltage": "2"}, "constant_current_a": -2.28},
        [D],
        2.28 * 3614 / 3600,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_it_is_read_and_cut(name):
    options, kinds, discharged_ah = FILES[name]
    record = read_record(DATA / name, ReadOptions(**options))
    assert [step.kind for step in record.trajectory.steps] == kinds
    if discharged_ah is not None:
        step, piece = next((s, p) for s, p in record.trajectory.pieces() if s.kind is D)
        assert piece.discharge_capacity[-1] == pytest.approx(discharged_ah, rel=0.01), step


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_the_wrong_sign_is_noticed(name):
    options, kinds, _ = FILES[name]
    if "constant_current_a" in options:
        options = {**options, "constant_current_a": 2.28}
    else:
        options = {**options, "current_sign": "discharge-positive"}
    with pytest.raises(BsaError, match="so it is not"):
        read_record(DATA / name, ReadOptions(**options))
    if "constant_current_a" not in options:
        found = read_record(DATA / name, ReadOptions(**{**options, "current_sign": "auto"}))
        assert [step.kind for step in found.trajectory.steps] == kinds


@pytest.mark.slow
def test_fifty_cycles_of_one_workbook():
    trajectory = read_record(DATA / "calce_cs2/CS2_35_8_30_10.xlsx").trajectory
    assert trajectory.cycles == tuple(range(1, 51))
    for number in range(2, 51):
        assert [step.kind for step in trajectory.cycle(number).steps] == CALCE
    assert np.all(np.diff(trajectory.time) >= 0)


@pytest.mark.slow
def test_every_discharge_of_a_life_has_the_same_steps():
    path = DATA / "nasa_pcoe/B0005_discharges.csv.gz"
    for test in ("1", "201", "613"):
        trajectory = read_record(path, ReadOptions(where={"test_id": test})).trajectory
        assert [step.kind for step in trajectory.steps] == [R, D, R]
