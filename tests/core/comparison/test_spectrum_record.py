"""Spectra as records: their clock, what is left out of them, and how their residuals lie."""

import numpy as np
import pytest
from bsa.core.cell import CELL, REACTANCE, RESISTANCE, SPECTRUM
from bsa.core.comparison.record_errors import errors_of_record
from bsa.core.comparison.residuals import residuals, rows_of
from bsa.core.comparison.signal_metrics import signal_errors
from bsa.core.comparison.spectrum_record import inductive_points, parts_of, recorded_spectrum, spectrum_record
from bsa.core.errors import BsaError
from bsa.core.inference.residual_errors import misfit_by_kind
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.spectrum import ImpedanceSpectrum
from bsa.core.target import Value
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory

FREQUENCY = np.logspace(4, -2, 61)
SPACE = ParameterSpace((Parameter("a", 1.0, 0.0, 2.0, target=Value("a")),))


def measured(inductance: float = 0.0) -> ImpedanceSpectrum:
    omega = 2 * np.pi * FREQUENCY
    impedance = 0.02 + 0.01 / (1 + 0.01j * omega) + 1j * omega * inductance
    return ImpedanceSpectrum("z.csv", FREQUENCY, impedance, 3.7)


def task(*more: Experiment, held_out: tuple[Experiment, ...] = ()) -> Task:
    signals = (*CELL.signals, *SPECTRUM)
    space = Experiment("z.csv", spectrum_record(measured()))
    return Task("t", CellModel(""), SPACE, (*more, space), signals=signals, held_out=held_out)


def test_the_clock_counts_decades_and_inductive_points_are_left_out() -> None:
    record = spectrum_record(measured())
    assert record.duration == pytest.approx(6.0)
    assert [step.kind for step in record.steps] == [StepKind.SPECTRUM]
    assert recorded_spectrum("z.csv", record).impedance == pytest.approx(measured().impedance)
    leads = measured(1e-6)
    record = spectrum_record(leads)
    assert inductive_points(leads) > 5
    # It begins on the real axis, between the last point that is left out and the first that is kept.
    assert len(record) == len(leads) - inductive_points(leads) + 1
    assert record.values(REACTANCE.name)[0] == pytest.approx(0.0)
    assert record.values(RESISTANCE.name)[0] == pytest.approx(leads.ohmic_resistance)
    assert np.all(record.values(REACTANCE.name) >= 0)


def test_a_spectrum_of_leads_alone_is_refused() -> None:
    leads = ImpedanceSpectrum("z.csv", FREQUENCY, 0.02 + 1e-6j * FREQUENCY)
    with pytest.raises(BsaError, match="0 points that are not inductive"):
        spectrum_record(leads)


def test_a_percent_of_the_impedance_is_a_tolerance_of_both_parts() -> None:
    one = task()
    impedance = measured().impedance
    record = spectrum_record(measured())
    off = 0.01 * (np.abs(impedance) + 0.1 * np.abs(impedance).max())
    for moved in (off, 1j * off):
        found = residuals(one, Outcome((ExperimentRun(record.changed(**parts_of(impedance + moved))),), 0.0))
        rows = rows_of(one)
        assert found is not None
        assert found.shape == rows.signal.shape == (80,)
        touched = rows.signal == (RESISTANCE.name if moved[0].real else REACTANCE.name)
        assert np.abs(found[touched]) == pytest.approx(1.0, rel=0.02)
        assert np.abs(found[~touched]) == pytest.approx(0.0, abs=1e-9)
        assert rows.scale == pytest.approx(1.0, rel=0.02)


def test_errors_are_told_in_milliohm_with_the_resistances() -> None:
    time = np.linspace(0.0, 100.0, 11)
    over_time = Trajectory(time, np.ones(11), np.full(11, 3.7), steps=(Step(StepKind.CC_DISCHARGE, 0, 11),))
    both = task(Experiment("v.csv", over_time))
    assert [quantity.unit for quantity in signal_errors(both)] == ["mV", "mohm", "mohm"]
    assert [quantity.unit for quantity in signal_errors(task())] == ["mohm", "mohm"]
    experiment = both.experiments[1]
    simulated = experiment.target.changed(**parts_of(measured().impedance + 0.003))
    found = errors_of_record(both, experiment, ExperimentRun(simulated))
    assert found.signals[RESISTANCE.name].unit == "mohm"
    assert found.signals[RESISTANCE.name].rms == pytest.approx(3.0)
    assert found.signals[REACTANCE.name].rms == pytest.approx(0.0, abs=1e-9)
    assert "voltage" not in found.signals
    assert found.impedance is not None
    assert found.impedance.ohmic_simulated_mohm - found.impedance.ohmic_mohm == pytest.approx(3.0)
    assert type(found).from_json(found.as_json()) == found


def test_what_the_voltage_leaves_says_nothing_of_a_spectrum() -> None:
    time = np.linspace(0.0, 100.0, 11)
    over_time = Trajectory(time, np.ones(11), np.full(11, 3.7), steps=(Step(StepKind.CC_DISCHARGE, 0, 11),))
    both = task(Experiment("v.csv", over_time))
    of_spectrum = rows_of(both).record == 1
    misfit = misfit_by_kind(both, np.where(of_spectrum, 3.0, -40.0))
    assert misfit[of_spectrum] == pytest.approx(3.0)
    assert misfit[~of_spectrum] == pytest.approx(40.0)
    # Residuals within their deviation are as large as they should be, and a single kind has but one noise.
    assert misfit_by_kind(both, np.full(len(of_spectrum), 0.5)) == pytest.approx(1.0)
    assert misfit_by_kind(task(), np.full(80, 7.0)) == pytest.approx(1.0)


def test_a_held_out_spectrum_has_its_own_signals_though_none_is_fitted() -> None:
    time = np.linspace(0.0, 100.0, 11)
    over_time = Trajectory(time, np.ones(11), np.full(11, 3.7), steps=(Step(StepKind.CC_DISCHARGE, 0, 11),))
    witness = Experiment("z.csv", spectrum_record(measured()))
    one = Task("t", CellModel(""), SPACE, (Experiment("v.csv", over_time),), held_out=(witness,))
    assert [signal.name for signal in one.observed_in(witness.target)] == ["resistance", "reactance"]
    assert [signal.name for signal in one.observed] == ["voltage"]
    bare = Trajectory(witness.target.time, steps=witness.target.steps, signals={"frequency": FREQUENCY})
    with pytest.raises(BsaError, match="lacks the signals"):
        Task("t", CellModel(""), SPACE, (Experiment("z.csv", bare),))
