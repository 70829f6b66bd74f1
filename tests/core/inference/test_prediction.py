from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bsa.core.encoding import decode_task, encode_task
from bsa.core.errors import BsaError
from bsa.core.inference.prediction import decode_prediction, encode_prediction, predict
from bsa.core.reading.switches import begins_under_load
from bsa.core.run.journal import FILE_NAME, read_events
from bsa.core.run.loop import RunResult
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.experiments.report.figures import prediction_overlays
from bsa.experiments.report.records import error_rows
from bsa.experiments.run import summary
from bsa.experiments.run_record import read_run
from bsa_toy_cell import HIDDEN, record, space, toy_task
from bsa_toy_life import life, life_task
from scipy.stats import t as student

RunToy = Callable[..., RunResult]
PROTOCOL = (("Rest for 60 seconds", "Discharge at 2 A until 3.2 V", "Rest for 600 seconds"),)


def with_held_out() -> Task:
    return replace(toy_task(), held_out=(Experiment("at 2 A", record(HIDDEN, 2.0), PROTOCOL),))


@pytest.mark.slow
def test_what_was_not_fitted_is_scored_beside_what_was(run_toy: RunToy, tmp_path: Path) -> None:
    task = with_held_out()
    result = run_toy(tmp_path, task=task, analysing=True)
    (fitted,), (held,) = result.records, result.held_out
    assert (fitted.record, held.errors.record) == ("toy record", "at 2 A")
    assert held.errors.signals["voltage"].rms < 10.0
    assert [step.name for step in held.errors.steps] == ["rest 1", "CC discharge", "rest 2"]
    band = held.bands["voltage"]
    assert 0 < band.rms <= band.max
    assert 0 <= band.inside <= 1
    assert held.curve is not None
    assert len(held.curve.values("voltage_band")) == len(held.curve)
    known = read_run(tmp_path)
    assert known.records == result.records
    assert [one.as_json() for one in known.held_out] == [held.as_json()]
    from bsa.core.run.run_config import RunConfig
    from bsa_toy_cell import toy_scaffold

    rows = summary(RunConfig(scaffold=toy_scaffold()), "rules", result)["records"]
    assert [(row["record"], row["fitted"]) for row in rows] == [("toy record", True), ("at 2 A", False)]


@pytest.mark.slow
def test_a_resumed_run_does_not_predict_again(run_toy: RunToy, tmp_path: Path) -> None:
    whole = run_toy(tmp_path, task=with_held_out())
    lines = (tmp_path / FILE_NAME).read_bytes().splitlines(keepends=True)
    (tmp_path / FILE_NAME).write_bytes(b"".join(lines[:-1]))
    again = run_toy(tmp_path, task=with_held_out())
    assert [event["event"] for event in read_events(tmp_path)].count("held-out") == 1
    assert [one.as_json() for one in again.held_out] == [one.as_json() for one in whole.held_out]
    assert again.records == whole.records
    assert not whole.held_out[0].bands  # without an analysis of the fit nothing is known of its covariance


@pytest.mark.slow
def test_a_prediction_from_before_the_posterior_was_known_is_made_again_with_bands(
    run_toy: RunToy, tmp_path: Path
) -> None:
    early = run_toy(tmp_path, task=with_held_out())
    late = run_toy(tmp_path, task=with_held_out(), analysing=True)
    again = run_toy(tmp_path, task=with_held_out(), analysing=True)
    assert not early.held_out[0].bands
    assert late.held_out[0].bands
    assert read_run(tmp_path).held_out[0].as_json() == late.held_out[0].as_json() == again.held_out[0].as_json()
    assert [event["event"] for event in read_events(tmp_path)].count("held-out") == 2


def test_a_task_keeps_its_held_out_records_and_takes_none_twice() -> None:
    task = with_held_out()
    started = replace(task, held_out=(replace(task.held_out[0], initial_voltage=4.1),))
    assert decode_task(encode_task(started)).held_out[0].initial_voltage == 4.1
    warm = replace(task, held_out=(replace(task.held_out[0], temperature_k=298.15, initial_temperature_k=303.15),))
    assert decode_task(encode_task(warm)).held_out[0].initial_temperature_k == 303.15
    assert "initial_temperature_k" not in encode_task(task)["held_out"][0]
    assert "held_out" not in encode_task(toy_task())
    with pytest.raises(BsaError, match="fitted and held out"):
        replace(task, held_out=task.experiments)


class Linear:
    """A cell whose voltage is linear in two parameters; starts where it is told to."""

    def __init__(self, target: Trajectory) -> None:
        self.target = target
        self.calls: list[int] = []

    def simulate_variant(self, candidates: Any, experiments: Any, exact: bool = False) -> Any:
        self.calls.append(len(candidates))
        for place, candidate in enumerate(candidates):
            runs = []
            for experiment in experiments:
                start = 4.0 if experiment.initial_voltage is None else experiment.initial_voltage
                time = self.target.time
                voltage = start - candidate["a"] * self.target.current - candidate["b"] * time / time[-1]
                runs.append(ExperimentRun(self.target.changed(voltage=voltage)))
            yield place, Outcome(tuple(runs), 0.0)


def linear_task(current: float = 1.0) -> tuple[Task, Trajectory]:
    from bsa.core.parameters import Parameter, ParameterSpace

    time = np.linspace(0.0, 100.0, 51)
    target = Trajectory(
        time, np.full_like(time, current), 4.0 - 0.2 * current - 0.3 * time / 100, None, (Step(StepKind.DRIVE, 0, 51),)
    )
    box = ParameterSpace((Parameter("a", 0.2, 0.0, 1.0), Parameter("b", 0.3, 0.0, 2.0)))
    return Task("linear", CellModel("Chen2020"), box, (Experiment("fitted", target),)), target


def test_the_band_is_what_the_draws_show() -> None:
    task, target = linear_task()
    draws = np.array([[0.22, 0.15], [0.18, 0.16], [0.2, 0.11]])
    candidate = {"a": 0.2, "b": 0.3}
    (found,) = predict(task, candidate, [Experiment("new", target)], Linear(target), draws.tolist())
    assert found.curve is not None
    slope = np.column_stack([-np.ones(51), -2.0 * target.time / 100])  # per unit of the box
    moved = slope @ (draws - [0.2, 0.15]).T
    expected = student.ppf(0.975, 3) * np.sqrt(np.mean(moved**2, axis=1))
    np.testing.assert_allclose(found.curve.values("voltage_band"), expected, rtol=1e-6)
    assert found.bands["voltage"].max == pytest.approx(1e3 * expected.max(), rel=1e-6)
    assert found.bands["voltage"].inside == 1.0
    again = decode_prediction(encode_prediction(found))
    assert again.as_json() == found.as_json()


def test_the_misfit_of_the_fitted_records_widens_the_band() -> None:
    task, target = linear_task()
    off = target.changed(voltage=target.voltage + 0.015)
    fit, new, draws = {"a": 0.2, "b": 0.3}, [Experiment("new", off)], [[0.201, 0.15], [0.199, 0.15]]
    (bare,), (wide,) = (
        predict(task, fit, new, Linear(target), draws, misfits)
        for misfits in ({"temperature": 5.0}, {"voltage": 10.0, "temperature": 5.0})
    )
    alone, both = bare.bands["voltage"], wide.bands["voltage"]
    assert (alone.inside, alone.misfit) == (0.0, 0.0)
    assert both.inside == 1.0
    assert both.misfit == pytest.approx(19.6)
    assert both.median == pytest.approx(np.hypot(alone.median, both.misfit))
    (told,) = error_rows(task, (), [wide])
    assert "; ± 19.6 from the misfit of the fitted records) holds 100 % of the time" in told.line


def test_a_band_too_wide_to_be_linear_is_named() -> None:
    task, target = linear_task()
    fit, new = {"a": 0.2, "b": 0.3}, [Experiment("new", target)]
    narrow, wide = (
        predict(task, fit, new, Linear(target), [[0.2 + off, 0.15], [0.2 - off, 0.15]])[0] for off in (1e-3, 0.02)
    )
    assert not narrow.bands["voltage"].wide
    assert wide.bands["voltage"].wide
    (told,), (silent,) = (error_rows(task, (), [found]) for found in (wide, narrow))
    band = wide.bands["voltage"]
    left_open = float(f"{np.sqrt(band.median**2 - band.misfit**2):.3g}")
    of_parameters = f"± {left_open:g} mV of this band come from parameters that the fitted records leave open"
    assert told.line.endswith(of_parameters)
    assert not silent.remark


def test_a_band_wider_than_the_range_of_the_records_is_told_as_not_determined() -> None:
    task, target = linear_task()
    draws = [[0.2 + off, 0.15] for off in (5.0, -5.0)]
    (found,) = predict(task, {"a": 0.2, "b": 0.3}, [Experiment("new", target)], Linear(target), draws)
    band = found.bands["voltage"]
    assert band.undetermined
    assert found.as_json()["bands"]["voltage"]["median"] == band.median > 1e3 * np.ptp(target.voltage)
    (told,) = error_rows(task, (), [found])
    assert "; 95 % band not determined; " in told.line
    assert told.line.endswith("is wider than the range of these records and of this one")
    assert "±" not in told.line
    (figure,) = prediction_overlays(replace(task, held_out=(Experiment("new", target),)), [found])
    assert "95 % band" not in [key.label for key in figure.chart.keys]


class EmptyFrom:
    """`Linear`, whose voltage stands at 2.5 V from a time on, whatever the parameters: an empty cell."""

    def __init__(self, target: Trajectory, since_s: float) -> None:
        self.linear, self.since_s = Linear(target), since_s

    def simulate_variant(self, candidates: Any, experiments: Any, exact: bool = False) -> Any:
        for place, outcome in self.linear.simulate_variant(candidates, experiments, exact):
            runs = []
            for run in outcome.runs:
                assert run.trajectory is not None
                empty = run.trajectory.time > self.since_s
                shown = run.trajectory.changed(voltage=np.where(empty, 2.5, run.trajectory.voltage))
                runs.append(ExperimentRun(shown, None, ("empty",), ((self.since_s, 100.0),)))
            yield place, Outcome(tuple(runs), 0.0)


def test_the_time_in_which_the_cell_is_empty_is_in_no_band() -> None:
    """There every draw shows the same voltage: it would narrow the median of the band, and hold nothing."""
    task, target = linear_task()
    fit, new, draws = {"a": 0.2, "b": 0.3}, [Experiment("new", target)], [[0.201, 0.15], [0.199, 0.15]]
    (whole,), (cut,), (never,) = (
        predict(task, fit, new, simulating, draws)
        for simulating in (Linear(target), EmptyFrom(target, 35.0), EmptyFrom(target, -1.0))
    )
    assert cut.bands["voltage"].median == pytest.approx(whole.bands["voltage"].median)
    assert cut.bands["voltage"].inside == 1.0
    assert cut.as_json()["at_limit"] == [[35.0, 100.0]]
    assert decode_prediction(encode_prediction(cut)).at_limit == ((35.0, 100.0),)
    assert cut.errors.signals["voltage"].max > 1000.0  # errors are over all of the record
    assert not never.bands
    (told,), (of_whole,) = (error_rows(task, (), [found]) for found in (cut, whole))
    assert "holds 100 % of the time in which the simulated cell was neither empty nor full; empty" in told.line
    assert of_whole.line.endswith("holds 100 % of the time")


def test_a_record_that_begins_under_load_starts_where_its_beginning_is_met() -> None:
    task, target = linear_task()
    assert begins_under_load(target)
    assert not begins_under_load(replace_current(target))
    loaded = Experiment("loaded", target, initial_voltage=float(target.voltage[0]))
    simulating = Linear(target)
    (found,) = predict(task, {"a": 0.2, "b": 0.3}, [loaded], simulating)
    assert found.errors.signals["voltage"].max < 1e-6
    (rested,) = predict(task, {"a": 0.2, "b": 0.3}, [replace(loaded, target=replace_current(target))], simulating)
    assert rested.simulations == 0


def test_a_first_sample_from_while_the_current_was_switched_on_does_not_set_the_start() -> None:
    task, target = linear_task()
    voltage = target.voltage.copy()
    voltage[0] += 0.05
    record = target.changed(voltage=voltage)
    loaded = Experiment("loaded", record, initial_voltage=float(record.voltage[0]))
    (found,) = predict(task, {"a": 0.2, "b": 0.3}, [loaded], Linear(target))
    assert found.curve is not None
    assert np.allclose(found.curve.voltage, target.voltage, atol=1e-6)


def test_a_first_sample_from_before_the_load_is_where_a_record_starts() -> None:
    """The model drops by 0.24 V where the cell drops by 0.2 V: the start is not moved to make up for it."""
    task, target = linear_task()
    voltage = target.voltage.copy()
    voltage[0] = 4.0
    loaded = Experiment("loaded", target.changed(voltage=voltage), initial_voltage=4.0)
    (found,) = predict(task, {"a": 0.24, "b": 0.3}, [loaded], Linear(target))
    assert found.curve is not None
    assert np.allclose(found.curve.voltage[1:], target.voltage[1:] - 0.04, atol=1e-6)
    assert found.simulations == 1


def replace_current(target: Trajectory) -> Trajectory:
    current = target.current.copy()
    current[0] = 0.0
    return target.changed(current=current)


def test_a_simulator_that_knows_its_task_alone_says_so() -> None:
    task, target = linear_task()

    class Alone(Linear):
        def simulate_variant(self, candidates: Any, experiments: Any, exact: bool = False) -> Any:
            return None

    with pytest.raises(BsaError, match="predicts no others"):
        predict(task, {"a": 0.2, "b": 0.3}, [Experiment("new", target)], Alone(target))
    assert space().names


class Fading:
    """A cell that loses so many A.h over a life, in proportion to its parameter, and is started anywhere."""

    def simulate_variant(self, candidates: Any, experiments: Any, exact: bool = False) -> Any:
        for place, candidate in enumerate(candidates):
            yield place, Outcome((ExperimentRun(life(100, candidate["rate"])),), 0.0)


def test_a_forecast_of_a_life_has_the_band_of_its_capacities() -> None:
    from bsa.core.parameters import Parameter, ParameterSpace

    whole = life(100, 0.2)
    box = ParameterSpace((Parameter("rate", 0.2, 0.0, 1.0),))
    task = replace(life_task(whole), space=box)
    later = replace(task.experiments[0], name="later", initial_voltage=3.4)
    (found,) = predict(task, {"rate": 0.2}, [later], Fading(), [[0.21], [0.19]], misfits={"capacity": 0.5})
    assert found.fade is not None
    share = np.arange(100) / 99
    # Two draws tell the deviation of what the parameters leave open: Student's t with two degrees of freedom.
    expected = np.hypot(4.302653 * 0.01 * share, 1.96 * 0.005)
    np.testing.assert_allclose(found.fade.half_ah, expected, rtol=1e-6)
    assert found.bands["capacity"].max == pytest.approx(100.0 * expected[-1])
    assert found.bands["capacity"].inside == 1.0
    again = decode_prediction(encode_prediction(found))
    assert again.fade == found.fade
    (*_, told) = error_rows(task, (), [found])
    assert "capacity 0 % rms" in told.line
