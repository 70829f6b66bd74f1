"""What a person says of records, parameters and options is kept."""

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bsa.core.comparison.residuals import residuals
from bsa.core.errors import BsaError
from bsa.core.reading.checks import to_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions, Record
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.target import CellChange
from bsa.core.task import ParameterFile, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.file_reading import FileReading
from bsa.experiments.tasks.cell_for_records import WIDTH, volume_and_surface, with_chosen_potentials
from bsa.experiments.tasks.measured_cell import CONTACT, RESISTANCE, CellRequest
from bsa.experiments.tasks.record_request import RECOGNISED, RecordRequest
from bsa.experiments.tasks.records import build_task, holding_out
from bsa.plugins.pybamm.cells.parameter_files import as_json, parsed
from bsa.plugins.pybamm.cells.parameter_sets import load
from bsa.plugins.pybamm.cells.state_of_charge import InitialState, equilibrium_capacity_ah

SOC = "Initial state of charge"


def record(name: str = "r", *, rest: bool = True, amperes: float = 5.0, cycles: int = 1, drift: float = 0.0) -> Record:
    """Discharges of an hour from 4.1 V with a jump of 30 mOhm, each charged again; ``drift`` A.h is lost a cycle."""
    times, currents, voltages, steps = [], [], [], []
    clock = 0.0
    count = 0
    for cycle in range(1, cycles + 1):
        legs = [(StepKind.CC_DISCHARGE, amperes, 3.95, 2.6)]
        if rest and cycle == 1:
            legs = [(StepKind.REST, 0.0, 4.1, 4.1), *legs]
        if cycles > 1:
            legs += [(StepKind.CC_CHARGE, -amperes + drift, 2.7, 4.15)]
        for kind, current, first, last in legs:
            time = clock + np.linspace(0.0, 600.0 if kind is StepKind.REST else 3600.0, 61)
            times.append(time)
            currents.append(np.full(61, current))
            voltages.append(np.linspace(first, last, 61))
            steps.append(Step(kind, count, count + 61, cycle, position=len(steps)))
            clock, count = float(time[-1]), count + 61
    return Record(
        name, Trajectory(np.concatenate(times), np.concatenate(currents), np.concatenate(voltages), None, tuple(steps))
    )


def task_of(*records: Record, **settings):
    return build_task("t", CellRequest("Chen2020", "SPM", **settings), [RecordRequest(one) for one in records])


def test_a_start_that_a_person_writes_is_never_replaced() -> None:
    search = {
        RESISTANCE: {"initial": 0.1265, "lower": 0.0, "upper": 0.3},
        SOC: {"initial": 0.7, "lower": 0.0, "upper": 1.0},
        WIDTH: {"initial": 1.2, "factors": [0.5, 2.0]},
    }
    big = record(amperes=15.0)
    space = task_of(big, search=search).space
    assert [space[name].initial for name in (RESISTANCE, SOC, WIDTH)] == [0.1265, 0.7, 1.2]
    several = task_of(big, record("s", amperes=15.0), search=search).space
    assert {parameter.initial for parameter in several if parameter.name.startswith(SOC)} == {0.7}
    measured = task_of(big, search={**search, RESISTANCE: {"lower": 0.0, "upper": 0.3}}).space
    assert measured[RESISTANCE].initial == pytest.approx(0.6 * 0.15 / 15.0, rel=1e-6)


def test_records_of_one_name_are_numbered_and_one_that_is_given_twice_is_refused() -> None:
    task = task_of(record(), record(amperes=2.0))
    assert [one.name for one in task.experiments] == ["r", "r (2)"]
    held = holding_out(task, [RecordRequest(record(amperes=1.0))])
    assert [one.name for one in held.held_out] == ["r (3)"]
    with pytest.raises(BsaError, match="is given twice"):
        task_of(record(), record())
    with pytest.raises(BsaError, match='the record "r" is fitted, so that its errors are no prediction'):
        holding_out(task, [RecordRequest(record())])


def slow(name: str = "r") -> Record:
    """Slow enough to stay cold."""
    found = record(name)
    return replace(found, trajectory=found.trajectory.changed(1.2 * found.trajectory.time))


def warming(kelvin: float) -> Record:
    found = record()
    rise = np.linspace(0.0, kelvin, len(found.trajectory))
    return replace(found, trajectory=found.trajectory.changed(temperature=298.15 + rise), ambient_k=298.15)


@pytest.mark.slow
def test_a_cell_that_warms_has_a_thermal_model_whose_temperature_is_fitted() -> None:
    warm = task_of(warming(12.0), search="cell")
    assert warm.cell.options["thermal"] == "lumped"
    assert [signal.name for signal in warm.observed] == ["voltage", "temperature"]
    assert {"Cell volume [m3]", "Total heat transfer coefficient [W.m-2.K-1]"} < set(warm.space.names)
    assert any("12.0 K" in note for note in warm.notes)
    (said,) = (note for note in warm.notes if "They get activation energies" in note)
    assert "negative particle diffusivity, positive particle diffusivity. They" in said  # an SPM has no electrolyte
    assert "(20, 20 kJ/mol" in said
    assert "Electrolyte conductivity activation energy [J.mol-1]" in load(warm.cell.parameter_set)
    assert "Negative particle diffusivity [m2.s-1] factor" in warm.space.names
    other = build_task("t", CellRequest("OKane2022", "SPM"), [RecordRequest(warming(12.0))])
    assert other.cell.options["thermal"] == "lumped"
    assert not any("diffusivities" in note for note in other.notes)
    # A record without a temperature is compared by its voltage.
    both = task_of(warming(12.0), record("s"), search="cell")
    assert [len(both.observed_in(experiment.target)) for experiment in both.experiments] == [2, 1]


@pytest.mark.slow
def test_transport_depends_on_the_temperature_where_the_temperatures_differ_and_nothing_was_said_of_it() -> None:
    energy, name = "Negative particle diffusivity activation energy [J.mol-1]", "Negative particle diffusivity [m2.s-1]"
    rooms = [replace(slow(key), ambient_k=kelvin) for key, kelvin in (("a", 283.15), ("b", 298.15))]
    assert energy in load(task_of(*rooms, search="cell").cell.parameter_set)
    assert energy not in load(task_of(rooms[0], search="cell").cell.parameter_set)
    asked = [RecordRequest(slow(key), temperature_k=kelvin) for key, kelvin in (("a", 283.15), ("b", 298.15))]
    assert energy in load(build_task("t", CellRequest("Chen2020", "SPM"), asked).cell.parameter_set)
    later = [RecordRequest(rooms[1])]
    colder = build_task("t", CellRequest("Chen2020", "SPM"), [RecordRequest(rooms[0])], held_out=later)
    assert energy in load(colder.cell.parameter_set)
    slowly = [replace(later[0], source=slow())]
    alike = build_task("t", CellRequest("Chen2020", "SPM"), [RecordRequest(rooms[1])], held_out=slowly)
    assert energy not in load(alike.cell.parameter_set)
    said = task_of(*rooms, search="cell", overrides={name: 2e-14})
    assert load(said.cell.parameter_set, said.cell.overrides)[name] == 2e-14
    own = task_of(*rooms, search={name: [1e-14, 1e-13]})
    assert own.cell.parameter_set == "Chen2020"
    assert any("may be predicted to end too early" in note for note in own.notes)


@pytest.mark.slow
def test_activation_energies_are_searched_where_the_fitted_records_tell_them() -> None:
    rate = "Negative particle diffusivity"
    name = f"{rate} additional activation energy [J.mol-1]"
    cold, warm = (RecordRequest(record(key), temperature_k=kelvin) for key, kelvin in (("a", 283.15), ("b", 298.15)))

    def task(*fitted: RecordRequest, held_out: Sequence[RecordRequest] = (), **more: Any) -> Task:
        return build_task("t", CellRequest("OKane2022", "SPM", **more), fitted, held_out)

    assert task(cold, warm).space[name].initial == 0.0
    assert any("15 K apart" in note for note in task(cold, warm).notes)
    assert name not in task(warm, held_out=[cold]).space
    assert name not in task(cold, warm, search={f"{rate} [m2.s-1] factor": {}}).space
    fixed = task(cold, warm, overrides={f"{rate} [m2.s-1]": 2e-14}).space
    assert [one for one in fixed.names if "additional" in one and rate in one] == []


@pytest.mark.slow
def test_an_ideal_electrolyte_is_replaced_by_a_measured_one_where_its_factor_is_searched() -> None:
    name = "Thermodynamic factor"
    started = build_task("t", CellRequest("Chen2020", search="cell"), [RecordRequest(record())])
    assert started.space[name].initial == load(started.cell.parameter_set, started.cell.overrides)[name] == 2.2
    assert any("2.2, that of measured electrolytes" in note for note in started.notes)
    measured = build_task("t", CellRequest("Ai2020", "SPM", search="cell"), [RecordRequest(record())])
    assert not any(name in searched for searched in measured.space.names)
    own = ParameterFile("own", "parameter-values", as_json(load("Chen2020")))
    kept = [
        measured,
        task_of(record(), search="geometry"),
        task_of(record(), search="cell"),  # the SPM has no electrolyte
        build_task("t", CellRequest("Chen2020", search="cell", overrides={name: 1.0}), [RecordRequest(record())]),
        build_task("t", CellRequest(own, search="cell"), [RecordRequest(record())]),
    ]
    for task in kept:
        assert not any("measured electrolytes" in note for note in task.notes)
    assert kept[-1].space[name].initial == 1.0


def test_a_cell_that_stays_cold_or_is_said_to_be_isothermal_has_no_thermal_model() -> None:
    kept = task_of(warming(12.0), options={"thermal": "isothermal"}, search="cell")
    for task in (task_of(warming(1.0), search="cell"), task_of(slow(), search="cell"), kept):
        assert task.cell.options.get("thermal", "isothermal") == "isothermal"
        assert [signal.name for signal in task.observed] == ["voltage"]
        assert "Cell volume [m3]" not in task.space


@pytest.mark.slow
def test_a_fast_cell_whose_temperature_was_not_measured_has_a_thermal_model_that_is_compared_by_its_voltage() -> None:
    task = task_of(record(rest=False, amperes=8.0), search="cell")
    assert task.cell.options["thermal"] == "lumped"
    assert [signal.name for signal in task.observed] == ["voltage"]
    assert any("The current reaches 1 times the cell's charge per hour" in note for note in task.notes)
    # Rests do not count, and a part of a discharge does not tell the charge.
    assert task_of(record(), search="cell").cell.options["thermal"] == "lumped"
    slow_one, fast_one = RecordRequest(slow()), RecordRequest(record("f", amperes=8.0))
    later = build_task("t", CellRequest("Chen2020", "SPM"), [slow_one], held_out=[fast_one])
    assert later.cell.options["thermal"] == "lumped"
    part = record()
    part = replace(part, trajectory=part.trajectory.changed(voltage=0.2 * part.trajectory.voltage + 3.0))
    assert "thermal" not in task_of(part, search="cell").cell.options


def test_a_fast_cell_whose_set_does_not_say_how_it_is_cooled_stays_isothermal_until_a_temperature_is_asked_for() -> (
    None
):
    cooling = "Total heat transfer coefficient [W.m-2.K-1]"
    stated = {key: value for key, value in json.loads(as_json(load("Chen2020"))).items() if key != cooling}
    file = ParameterFile("cell.json", "parameter-values", json.dumps(stated))
    request = RecordRequest(record(rest=False, amperes=8.0))
    task = build_task("t", CellRequest(file, "SPM"), [request])
    assert "thermal" not in task.cell.options
    assert any("cell.json does not say how its cell is cooled. The model stays isothermal" in n for n in task.notes)
    asked = build_task("t", CellRequest(file, "SPM", options={"thermal": "lumped"}), [request])
    assert asked.space[cooling].initial == 10.0
    assert any("a heat transfer coefficient of 10 W.m-2.K-1 is taken, that of Chen2020" in n for n in asked.notes)


def test_a_cell_of_another_size_has_another_volume_and_surface() -> None:
    twice = task_of(record(amperes=10.0), search="cell").cell.overrides
    factor = twice[WIDTH] / 1.58
    assert twice["Cell volume [m3]"] == pytest.approx(2.42e-5 * factor)
    assert twice["Cell cooling surface area [m2]"] == pytest.approx(5.31e-3 * factor ** (2 / 3))


def test_c_rates_are_those_of_the_cell_at_hand() -> None:
    """Protocols that are proposed next, and effects that count charge, take the nominal capacity."""
    name = "Nominal cell capacity [A.h]"
    twice = task_of(record(amperes=10.0), search="cell").cell.overrides
    assert twice[name] == pytest.approx(5.0 * twice[WIDTH] / 1.58)
    assert name not in task_of(record(amperes=4.6), search="cell").cell.overrides
    # A protocol in C-rates was one of the set's.
    request = RecordRequest(record(), protocol=(("Discharge at 1C for 10 minutes",),))
    wanted = CellRequest("Chen2020", overrides={WIDTH: 3.16}, search="geometry")
    assert name not in build_task("t", wanted, [request]).cell.overrides


def test_a_cell_of_many_sheets_is_not_cooled_like_one_sheet() -> None:
    sizes, (said,) = volume_and_surface(load("NCA_Kim2011"), 5.0)
    assert "single electrode sheet" in said
    # A cylindrical cell of 18 mm times 65 mm has 0.0042 m2 for 1.65e-5 m3.
    assert sizes["Cell cooling surface area [m2]"] / sizes["Cell volume [m3]"] ** (2 / 3) == pytest.approx(7.0)
    assert volume_and_surface(load("Ai2020"), 5.0)[1] == []


def test_a_written_start_widens_the_bounds_of_a_preset() -> None:
    space = task_of(record(), search={RESISTANCE: {"initial": 0.5}}).space
    assert (space[RESISTANCE].initial, space[RESISTANCE].upper) == (0.5, 0.5)


@pytest.mark.slow
def test_a_value_that_is_known_better_is_not_searched_by_a_preset() -> None:
    task = task_of(record(), overrides={RESISTANCE: 0.1265}, search="cell")
    assert RESISTANCE not in task.space
    assert task.cell.overrides[RESISTANCE] == 0.1265
    assert SOC in task.space


@pytest.mark.slow
def test_a_voltage_under_load_is_no_open_circuit_voltage() -> None:
    at_rest, loaded = (task_of(record(rest=rest), search="cell") for rest in (True, False))
    assert at_rest.experiments[0].initial_soc == pytest.approx(loaded.experiments[0].initial_soc, abs=0.3)
    assert loaded.experiments[0].initial_soc > 0.95  # it gives five of its 5.15 A.h
    (note,) = [note for note in loaded.notes if "begins under load" in note]
    assert " V at 5 A of discharge), and no current step shows its resistance: this voltage is assumed to be" in note
    assert "the open-circuit voltage, which is higher (give --initial-soc where it is known)" in note
    few = record(rest=False, amperes=0.5)
    shown = record(rest=False, amperes=0.5, cycles=2)
    unknown, jumps = (task_of(one, search="cell", scale_to_capacity=False) for one in (few, shown))
    assert jumps.experiments[0].initial_soc > unknown.experiments[0].initial_soc
    asked = build_task("t", CellRequest("Chen2020", "SPM"), [RecordRequest(record(rest=False), initial_soc=0.9)])
    assert asked.experiments[0].initial_soc == asked.space[SOC].initial == 0.9


@pytest.mark.slow
@pytest.mark.parametrize(("kelvin", "shown"), [(290.0, True), (313.15, False)])
def test_a_voltage_under_load_is_corrected_by_what_a_record_at_its_temperature_shows(
    kelvin: float, shown: bool
) -> None:
    loaded, jumps = replace(record("loaded", rest=False), ambient_k=298.15), record("jumps", cycles=2, amperes=2.5)
    both = [RecordRequest(loaded), RecordRequest(jumps, temperature_k=kelvin)]
    task = build_task("t", CellRequest("Chen2020", "SPM"), both)
    (note,) = [note for note in task.notes if note.startswith("loaded: begins under load")]
    assert ("which the other records' current steps show" in note) == shown
    assert ("no current step shows its resistance" in note) != shown


def test_charge_that_drifts_over_cycles_does_not_make_a_larger_cell() -> None:
    drifting = record(cycles=20, drift=1.0)
    assert np.ptp(drifting.trajectory.discharge_capacity) > 15.0
    full = 5.0 / 0.91  # it starts at 4.1 V
    assert task_of(drifting, search="cell").cell.overrides[WIDTH] == pytest.approx(1.58 * full / 5.15, rel=0.01)
    twice = task_of(record(cycles=20, amperes=10.0, drift=0.5), search="cell")
    assert twice.cell.overrides[WIDTH] == pytest.approx(1.58 * 2.0 * full / 5.15, rel=0.01)


@pytest.mark.slow
def test_a_cold_record_starts_where_the_cold_cell_shows_its_first_voltage() -> None:
    cold = replace(record(), ambient_k=273.15)
    search = {SOC: {"lower": 0.0, "upper": 1.0}}
    task = build_task("t", CellRequest("Mohtat2020", "SPM", search=search), [RecordRequest(cold)])
    start = task.experiments[0].initial_soc
    values = load("Mohtat2020", task.cell.overrides)
    values.update({"Initial temperature [K]": 273.15})
    assert start == pytest.approx(InitialState(values).soc_at(4.1), abs=5e-4)


@pytest.mark.slow
def test_an_option_of_a_person_is_kept() -> None:
    assert task_of(record(), options={"contact resistance": True}).cell.options[CONTACT] == "true"
    off = task_of(record(), options={"Contact resistance": False})
    assert off.cell.options[CONTACT] == "false"
    assert RESISTANCE not in off.space


def slow_discharge(hours: float = 20.0) -> Record:
    """The open-circuit voltage of Ecker2015 over so many hours, at about C/20 by default, for a cell of 5 A.h."""
    values = load("Ecker2015")
    area = values["Electrode width [m]"] * values["Electrode height [m]"]
    share = np.linspace(0.0, 0.98, 201)
    drawn = share * equilibrium_capacity_ah("Ecker2015", {}) * 3600.0 / 96485.332 / area
    voltage = InitialState(values).voltages(CellChange(), 0.99, drawn)
    step = (Step(StepKind.CC_DISCHARGE, 0, 201),)
    return Record(
        "slow", Trajectory(np.linspace(0.0, 3600.0 * hours, 201), np.full(201, 5.0 / hours), voltage, None, step)
    )


def test_the_potentials_of_another_set_are_offered_and_taken_where_that_is_asked() -> None:
    kept = task_of(slow_discharge(), search={WIDTH: {"factors": [0.5, 2.0]}})
    assert kept.cell.parameter_set == "Chen2020"
    assert any("--ocp nearest" in note for note in kept.notes)
    assert not any("corrected" in note for note in kept.notes)
    taken = task_of(slow_discharge(), ocp="Ecker2015")
    assert str(taken.cell.parameter_set) == "Chen2020 with the potentials of Ecker2015"
    assert any("those of Ecker2015 0." in note for note in taken.notes)
    assert not any("--ocp" in note for note in taken.notes)


def test_a_slow_record_corrects_the_potentials_of_a_named_set_where_a_preset_searches_them() -> None:
    task = build_task("t", CellRequest("Mohtat2020", "SPM"), [RecordRequest(slow_discharge())])
    assert str(task.cell.parameter_set) == "Mohtat2020 with corrected potentials"
    assert any("Mohtat2020 leave" in note and "corrected by that record" in note for note in task.notes)
    with_own = parsed("own.json", as_json(load("Mohtat2020")))
    kept = build_task("t", CellRequest(with_own, "SPM"), [RecordRequest(slow_discharge())])
    assert kept.cell.parameter_set == with_own


@pytest.mark.slow
def test_the_nearest_set_is_that_of_the_positive_electrode() -> None:
    task = build_task("t", CellRequest("nearest", "SPM"), [RecordRequest(slow_discharge())])
    assert str(task.cell.parameter_set) == "Ecker2015 with the potentials of Ecker2015"
    assert any("all else from Ecker2015" in note for note in task.notes)
    assert not any("Rates of" in note for note in task.notes)
    with pytest.raises(BsaError, match="at 1C or less"):
        build_task("t", CellRequest("nearest", "SPM"), [RecordRequest(slow_discharge(hours=0.5))])


def test_without_a_slow_record_a_discharge_at_1c_tells_the_set_and_a_note_says_so() -> None:
    notes = build_task("t", CellRequest("nearest", "SPM"), [RecordRequest(slow_discharge(hours=1.0))]).notes
    assert any(
        "of the record at about 1C (none is slow" in note and "all else from Ecker2015" in note for note in notes
    )


@pytest.mark.slow
def test_that_no_published_potentials_come_near_is_said() -> None:
    slow = slow_discharge()
    titanate = replace(slow, trajectory=slow.trajectory.changed(voltage=slow.trajectory.voltage - 1.5))
    assert any("No pair comes near" in note for note in with_chosen_potentials("nearest", "", [titanate], True)[1])
    assert not any("No pair comes near" in note for note in with_chosen_potentials("nearest", "", [slow], True)[1])


def test_rates_of_the_nearest_set_that_are_far_from_all_others_are_replaced_and_those_of_a_named_set_kept() -> None:
    nearest = with_chosen_potentials("nearest", "NCA_Kim2011", [slow_discharge()], True)
    assert str(nearest[0]).endswith("with usual rates")
    assert any("negative particle diffusivity times 0.028" in note for note in nearest[1])
    named = with_chosen_potentials("NCA_Kim2011", "NCA_Kim2011", [slow_discharge()], True)
    assert not str(named[0]).endswith("with usual rates")


def test_nothing_is_said_of_potentials_that_are_near_or_where_every_record_is_fast() -> None:
    assert not any("open-circuit potentials" in note for note in task_of(slow_discharge(hours=0.5)).notes)
    own = build_task("t", CellRequest("Ecker2015", "SPM"), [RecordRequest(slow_discharge())])
    assert not any("open-circuit potentials" in note for note in own.notes)


@pytest.mark.slow
def test_effects_are_part_of_the_model_and_their_parameters_are_searched() -> None:
    task = task_of(record(), effects=["ocp-hysteresis"])
    assert task.cell.effects == ("ocp-hysteresis",)
    assert "ocp-hysteresis: half_gap [V]" in task.space.names
    with pytest.raises(BsaError, match='no effect "hysteresis"'):
        task_of(record(), effects=["hysteresis"])


@pytest.mark.slow
def test_an_effect_on_the_measured_current_is_refused_where_a_protocol_is_simulated() -> None:
    told = RecordRequest(record(), protocol=(("Discharge at 5 A for 10 minutes",),), initial_soc=0.9)
    with pytest.raises(BsaError, match="acts on the measured current"):
        build_task("t", CellRequest("Chen2020", "SPM", effects=["self-discharge"]), [told])
    driven = build_task(
        "t", CellRequest("Chen2020", "SPM", effects=["self-discharge"]), [RecordRequest(record("driven"))]
    )
    with pytest.raises(BsaError, match="acts on the measured current"):
        holding_out(driven, [told])


@pytest.mark.parametrize(("gap_v", "said"), [(0.05, True), (0.01, False)])
def test_a_slow_charge_far_above_the_discharge_is_a_hysteresis(gap_v: float, said: bool) -> None:
    down = slow_discharge().trajectory
    back = np.concatenate([down.time, down.time[-1] + 1.0 + down.time])
    voltage = np.concatenate([down.voltage, down.voltage[::-1] + gap_v])
    steps = (Step(StepKind.CC_DISCHARGE, 0, 201), Step(StepKind.CC_CHARGE, 201, 402, position=1))
    both = Record("both", Trajectory(back, np.repeat([0.25, -0.25], 201), voltage, None, steps))
    notes = task_of(both, ocp="Ecker2015").notes
    assert any("50 mV apart" in note and "--effect ocp-hysteresis" in note for note in notes) == said
    assert not any("--effect" in note for note in task_of(both, effects=["ocp-hysteresis"]).notes)


@pytest.mark.parametrize(
    ("parameter_set", "ocp", "hint"),
    [
        ("nearest", "", "add one, or name a set with --parameters (bsa list parameters shows all)."),
        ("nearest", "nearest", "name a set with --parameters (bsa list parameters shows all) and leave --ocp out."),
        ("Chen2020", "nearest", "add one, or leave --ocp out."),
    ],
)
def test_where_every_record_is_fast_what_was_asked_for_is_to_be_left_out(parameter_set, ocp, hint):
    with pytest.raises(BsaError, match="at 1C or less") as found:
        with_chosen_potentials(parameter_set, ocp, [slow_discharge(hours=0.5)], True)
    assert found.value.hint.endswith(hint)


def test_a_sample_of_two_moments_is_not_compared_unless_the_record_is_to_stay_as_it_is() -> None:
    whole = record()
    time = np.append(whole.trajectory.time, whole.trajectory.time[-1] + np.arange(1.0, 6.0))
    current = np.append(whole.trajectory.current, np.zeros(5))
    voltage = np.append(whole.trajectory.voltage, [2.6, 2.75, 2.76, 2.77, 2.78])  # the first one is under load still
    steps = (*whole.trajectory.steps, Step(StepKind.REST, 122, 127, position=2))
    rested = Record("rested", Trajectory(time, current, voltage, steps=steps))
    task = build_task("t", CellRequest("Chen2020", "SPM"), [RecordRequest(whole)], [RecordRequest(rested)])
    kept = FileReading(ReadOptions(voltage_lag_s=0.0))
    for fitted, mixed in ((task_of(rested), [122]), (task_of(whole), [])):
        assert np.flatnonzero(fitted.experiments[0].target.inserted).tolist() == mixed
        assert any("are not of one moment" in note for note in fitted.notes) == bool(mixed)
    assert np.flatnonzero(task.held_out[0].target.inserted).tolist() == [122]
    assert any(note.startswith("rested (held out): current and voltage of a sample") for note in task.notes)
    as_written = build_task("t", CellRequest("Chen2020", "SPM"), [RecordRequest(rested, kept)])
    assert not as_written.experiments[0].target.inserted.any()


@pytest.mark.slow
def test_cycles_of_a_simulated_protocol_are_counted_from_the_first_that_is_kept() -> None:
    """A simulation that equals the record leaves nothing, whichever cycles of the file are chosen."""
    once = np.arange(0.0, 10800.0, 20.0)
    current = np.where(once < 3600.0, -5.0, np.where(once < 5400.0, 0.0, np.where(once < 9000.0, 5.0, 0.0)))
    charging = np.clip(once - 5400.0, 0.0, 3600.0) / 3600.0
    voltage = np.where(once < 3600.0, 4.0 - 1.2 * once / 3600.0, 2.8 + 1.2 * charging)
    cycle = np.repeat([1.0, 2.0, 3.0], len(once))
    time = np.concatenate([once + 10800.0 * number for number in range(3)])
    samples = Samples("a.csv", time, np.tile(voltage, 3), np.tile(current, 3), extra={"cycle": cycle})
    for cycles in (None, (2, 2), (2, 3)):
        record = to_record(samples, ReadOptions(cycles=cycles))
        task = build_task("t", CellRequest("Chen2020", "SPM"), [RecordRequest(record, protocol=RECOGNISED)])
        (experiment,) = task.experiments
        assert experiment.target.cycles == tuple(range(1, len(experiment.protocol or ()) + 1))
        found = residuals(task, Outcome((ExperimentRun(experiment.target),)))
        assert found is not None
        assert np.allclose(found, 0.0)
