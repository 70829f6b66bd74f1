"""A cycler's file of a whole life as a task: what is fitted, and what is forecast."""

import json
from pathlib import Path

import bsa
import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.switches import begins_under_load
from bsa.core.record import Record
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.read_options import reading
from bsa.experiments.task_request import CellChoice, Records, task_of_records
from bsa.experiments.tasks.lives import USUAL_GROWTH, cracks_note, with_ageing
from bsa.experiments.tasks.record_request import RecordRequest
from bsa.experiments.tasks.records import holding_out
from bsa.experiments.tasks.task_file import ExperimentEntry

CUT_SHORT = 17
GROWTH = "SEI solvent diffusivity [m2.s-1]"


def life(count: int = 40, name: str = "cell.csv", rests: bool = True) -> Record:
    """Charges and discharges at 5 A that lose 0.5 % a cycle; one of them was cut short."""
    times, currents, voltages, steps = [], [], [], []
    clock, samples = 0.0, 0
    for cycle in range(1, count + 1):
        ah = 5.0 * (1.0 - 0.005 * (cycle - 1)) * (0.8 if cycle == CUT_SHORT else 1.0)
        legs = [
            (StepKind.REST, 0.0, 3.2 if cycle == 1 else 2.8, 600.0),
            (StepKind.CC_CHARGE, -5.0, 4.2, 720.0 * ah),
            (StepKind.CC_DISCHARGE, 5.0, 2.5, 720.0 * ah),
        ]
        for position, (kind, current, last, seconds) in enumerate(legs if rests or cycle == 1 else legs[1:]):
            times.append(clock + np.linspace(1e-3, seconds, 21))
            currents.append(np.full(21, current))
            voltages.append(np.linspace(3.4 if current else last, last, 21))
            steps.append(Step(kind, samples, samples + 21, cycle, position=position))
            clock, samples = clock + seconds, samples + 21
    parts = (np.concatenate(part) for part in (times, currents, voltages))
    return Record(name, Trajectory(*parts, None, tuple(steps)))


def task_of(record: Record, **settings):  # type: ignore[no-untyped-def]
    return task_of_records(Records([record], **settings), CellChoice("Chen2020", "SPM"))


def test_the_first_cycles_are_fitted_and_the_later_ones_held_out() -> None:
    task = task_of(life(), fit_cycles=30)
    (fitted,), (later,) = task.experiments, task.held_out
    assert (fitted.name, later.name) == ("cell.csv, cycles 1 to 30", "cell.csv, cycles 31 to 40")
    assert fitted.protocol == (("Rest for 600 seconds", *fitted.protocol[0][1:]),) * 30
    assert fitted.protocol[0][1:] == ("Charge at 5 A until 4.200 V", "Discharge at 5 A until 2.500 V")
    assert later.protocol == (fitted.protocol[0],) * 40
    assert list(fitted.target.cycle_table.cycle) == [n for n in range(1, 31) if n != CUT_SHORT]
    assert list(later.target.cycle_table.cycle) == list(range(31, 41))
    assert max(fitted.detailed_cycles) == 30
    assert min(later.detailed_cycles) == 31
    # Both begin where the life began, at 3.2 V.
    assert later.initial_voltage == pytest.approx(3.2)
    assert fitted.initial_voltage == pytest.approx(3.2)
    assert task.space["Initial voltage correction at 3.20 V [V]"].initial == 0.0
    # What is said of the whole life is headed by its name.
    (told,) = [note for note in task.notes if "1 of 40 cycles were cut short" in note]
    assert told.startswith("cell.csv: ")


def test_later_cycles_that_begin_under_load_are_not_said_to_be_started_there() -> None:
    task = task_of(life(rests=False), fit_cycles=30)
    assert begins_under_load(task.held_out[0].target)
    # It is the first cycle of the life that is simulated first.
    assert not any("begins under load; it is started" in note for note in task.notes)


def test_the_cell_and_what_ages_it_are_searched() -> None:
    task = task_of(life(), life=True)
    assert not task.held_out
    assert task.cell.options["SEI"] == USUAL_GROWTH["SEI"]
    assert any("No mechanism of ageing was named" in note for note in task.notes)
    assert GROWTH in task.space
    assert "Electrode width [m]" in task.space
    growth = task.space[GROWTH]
    assert growth.upper / growth.initial == pytest.approx(1e5)


def test_a_mechanism_that_is_named_stays_alone() -> None:
    named = {"lithium plating": "irreversible"}
    assert with_ageing(named) == (named, "")
    assert with_ageing({"SEI": "none"}) == ({"SEI": "none"}, "")
    options, note = with_ageing({"thermal": "lumped"})
    assert options == {"SEI": USUAL_GROWTH["SEI"], "SEI film resistance": "distributed", "thermal": "lumped"}
    assert note


def test_cracks_whose_lithium_the_model_keeps_are_named() -> None:
    on_cracks = {"SEI": "solvent-diffusion limited", "SEI on cracks": ["true", "false"]}
    assert "DFN takes it" in cracks_note("SPM", on_cracks)[0]
    assert not cracks_note("DFN", on_cracks)
    assert not cracks_note("SPM", {"SEI": "solvent-diffusion limited"})


def test_records_held_out_of_a_life_are_lives() -> None:
    task = task_of(life(), life=True)
    (other,) = holding_out(task, [RecordRequest(life(25, "other.csv"))]).held_out
    assert other.name == "other.csv, cycles 1 to 25"
    assert other.long


def test_what_is_no_life_is_refused() -> None:
    with pytest.raises(BsaError, match="2 are alike"):
        task_of(life(2), life=True)


@pytest.mark.slow
def test_many_cycles_that_are_no_life_are_named() -> None:
    def told(count: int) -> bool:
        return any("--life" in note and f"all {count} cycles" in note for note in task_of(life(count)).notes)

    assert told(60)
    assert not told(40)


def test_a_task_file_divides_a_recognised_life_alone() -> None:
    entry = {"data": "x.csv", "fit_cycles": 3}
    with pytest.raises(ValueError, match="goes with protocol: recognised"):
        ExperimentEntry.model_validate(entry)
    divided = ExperimentEntry.model_validate({**entry, "protocol": "recognised", "detailed_cycles": "auto"})
    assert divided.fit_cycles == 3


CALCE = Path(__file__).parents[4] / "shared" / "data" / "calce_cs2" / "CS2_35_all.csv.gz"


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not CALCE.is_file(), reason="the measured cells are not beside this checkout")
def test_a_measured_life_is_read() -> None:
    records = Records([CALCE], reads=[reading(cycles="1-500")], fit_cycles=200)
    task = task_of_records(records, CellChoice("Ai2020", "SPM"))
    (fitted,), (later,) = task.experiments, task.held_out
    assert fitted.protocol is not None
    assert [step.split(" at ")[0] for step in fitted.protocol[0]][1:6:2] == ["Charge", "Hold", "Discharge"]
    # The cycler's own counter says 1.1385 A.h; its samples come up to 30 s late.
    assert fitted.target.cycle_table.capacity_ah[0] == pytest.approx(1.1385, abs=5e-4)
    assert fitted.target.cycle_table.capacity_ah[1] == pytest.approx(1.1377, abs=5e-4)
    assert len(fitted.target.cycle_table) > 185
    assert later.target.cycle_table.capacity_ah[-1] == pytest.approx(0.934, abs=2e-3)


@pytest.mark.slow
def test_a_simulated_life_is_fitted_and_forecast(tmp_path: Path) -> None:
    """A growth that is off by orders of magnitude, from the first five cycles; the last four lie in the band."""
    from bsa.core.target import Value
    from bsa.core.task import CellModel, Experiment
    from bsa.plugins.pybamm.solving.long_experiment import LongExperiment

    options = {"SEI": "solvent-diffusion limited", "SEI film resistance": "distributed"}
    cycle = ("Charge at 5 A until 4.2 V", "Rest for 10 minutes", "Discharge at 5 A until 2.6 V", "Rest for 10 minutes")
    nothing = Trajectory(np.zeros(1), np.zeros(1), np.zeros(1))
    every = Experiment("made", nothing, (cycle,) * 9, initial_soc=0.05, detailed_cycles=tuple(range(1, 10)))
    made = LongExperiment(CellModel("Chen2020", "SPM", options), every, {GROWTH: Value(GROWTH)}, leave_out=False)
    record = made.solve({GROWTH: 1e-19}).trajectory
    assert record is not None
    whole = Record("made", Trajectory(record.time, steps=record.steps, signals=record.signals))
    search = {GROWTH: {"initial": 2.5e-22, "lower": 2.5e-25, "upper": 2.5e-17, "scale": "log"}}
    found = bsa.calibrate(
        whole,
        parameters="Chen2020",
        model="SPM",
        options=options,
        search=search,
        scale=False,
        fit_cycles=5,
        scaffold="ageing",
        simulations=30,
        out=tmp_path / "run",
        progress=False,
    )
    assert found.parameters[GROWTH] == pytest.approx(1e-19, rel=0.05, abs=0.0)
    records = json.loads((tmp_path / "run" / "result.json").read_text())["records"]
    (later,) = [row for row in records if not row["fitted"]]
    assert later["signals"]["capacity"]["max"] < 0.05
    assert later["bands"]["capacity"]["inside"] == 1.0
