import discovery_toy as toy
import numpy as np
import pytest
from bsa.core.discovery.base_fit import calibrate
from bsa.core.discovery.engine import Engine
from bsa.core.discovery.findings import Settings
from bsa.core.discovery.first_cycles import first_cycle, longer, near_cycles
from bsa.core.discovery.fitting import Fitter
from bsa.core.discovery.judgement import errors_in_words
from hypothesis import given
from hypothesis import strategies as st


def cycled(truth, cycles=12, held=True):
    rng = np.random.default_rng(5)
    fitted = [toy.measured_record("cycled", rng, truth, program=toy.CYCLE, cycles=cycles)]
    return toy.problem_of(fitted, [toy.measured_record("held", rng, truth)] if held else [])


def test_a_long_record_is_cut_after_its_first_cycle():
    problem, _ = cycled({})
    new = first_cycle(problem)
    assert set(new.observations[0].cycle) == {1}
    assert new.observations[0].measured_record.record.cycles == (1,)
    assert new.observations[0].measured_record.soc_name == problem.observations[0].measured_record.soc_name
    assert np.array_equal(new.observations[0].voltage, problem.observations[0].voltage[: len(new.observations[0])])
    assert new.held_observations == problem.held_observations


@pytest.mark.parametrize("held", [True, False])
def test_the_same_stretches_are_kept_back(held):
    problem, _ = cycled({}, held=held)
    new = first_cycle(problem)
    assert not np.all(problem.fitted[0])
    assert np.array_equal(new.fitted[0], problem.fitted[0][: len(new.fitted[0])])


def test_a_first_cycle_of_so_few_averages_that_none_is_held_out_is_judged():
    rng = np.random.default_rng(0)
    problem, space = toy.problem_of([toy.measured_record("a", rng, {}, program=((1, 24), (-1, 24)), cycles=12)], [])
    new = first_cycle(problem)
    assert np.all(new.fitted[0])
    found = Fitter(new, space, print).at((), np.zeros(len(space)))
    assert (found.held_rmse_v, found.held_errors) == (np.inf, ())
    assert errors_in_words(found).startswith(f"{1e3 * found.rmse_v:.2f} mV (")


def test_data_not_fitted_can_show_ageing_that_a_hold_out_record_of_one_cycle_cannot():
    problem, _ = cycled({"fade": 0.02})
    as_new = {"resistance factor": 1.2, problem.observations[0].measured_record.soc_name: 0.9}
    (kept_back, drifted), (held, flat) = problem.held_out((), as_new)
    assert (kept_back.name, held.name) == ("cycled", "held")
    assert len(kept_back) == np.sum(~problem.fitted[0])
    assert np.std(drifted) > 10 * problem.noise_v
    assert np.std(drifted) > 3 * np.std(flat)
    assert problem.held_noise_v == pytest.approx(1e-3, rel=0.2)


def test_a_short_record_is_not_cut():
    problem, _ = cycled({}, cycles=5)
    assert first_cycle(problem) is None


def test_what_is_known_of_the_mesh_is_cut_too():
    problem, _ = cycled({})
    count = len(problem.observations[0])
    problem.corrections["cycled"] = np.arange(float(count))
    problem.mesh_sigma["cycled"] = np.arange(float(count))
    new = first_cycle(problem)
    assert len(new.corrections["cycled"]) == len(new.mesh_sigma["cycled"]) == len(new.observations[0])
    assert len(problem.corrections["cycled"]) == count


@pytest.mark.slow
@given(st.integers(1, 12), st.floats(0.011, 1.0))
def test_records_are_cut_where_they_have_drifted_far(first_far, size):
    problem, _ = cycled({})
    observed = problem.observations[0]
    errors = np.where(observed.cycle >= first_far, size, 0.001)
    near = near_cycles(problem, [errors])
    assert max(near.observations[0].cycle) == max(3, first_far - 1)


def test_what_does_not_drift_is_not_cut():
    problem, _ = cycled({})
    assert near_cycles(problem, [np.full(len(problem.observations[0]), 0.005)]) is None


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-3, 0.05])
def test_ageing_is_added_to_the_cell_as_it_was_new(size):
    # The strong one adds as much resistance in twelve cycles as ten cells have: a base fit of all cycles is no start.
    problem, space = cycled({"fade": size})
    findings = Engine(problem, space, (toy.FADE, toy.QUADRATIC, toy.HYSTERESIS), toy.EVIDENCE, Settings()).run()
    assert findings.verdict == "effect-found", findings.reason
    assert findings.best.names == ("fade",)
    assert findings.best.estimates["fade"][0].value == pytest.approx(size, rel=0.05)
    assert findings.best.fit.candidate["resistance factor"] == pytest.approx(1.2, rel=0.02)


@pytest.mark.slow
def test_parameters_of_the_first_cycle_are_those_of_the_cell_as_it_was_new():
    problem, space = cycled({"fade": 0.02})
    fitter = Fitter(problem, space, lambda text: None)
    base = calibrate(fitter)
    bent = base.fit.candidate["resistance factor"]
    assert space.parameters[0].at_coordinate(float(fitter.as_new[0])) == pytest.approx(1.2, rel=0.1)
    assert bent > 1.5


@pytest.mark.slow
def test_a_cell_that_does_not_age_lacks_nothing():
    problem, space = cycled({})
    assert Engine(problem, space, (toy.FADE,), toy.EVIDENCE).run().verdict == "no-missing-effect"


def test_a_horizon_is_doubled_until_the_whole_is_reached():
    problem, _ = cycled({}, cycles=20)
    near = near_cycles(problem, [np.where(problem.observations[0].cycle > 3, 1.0, 0.0)])
    assert [len(stage.observations[0].measured_record.record.cycles) for stage in longer(problem, near)] == [6, 12]


@pytest.mark.slow
def test_no_second_effect_is_sought_over_many_cycles(monkeypatch):
    problem, space = cycled({"fade": 0.02, "slow": 0.01})
    engine = Engine(problem, space, (toy.FADE, toy.SLOW), toy.EVIDENCE, Settings(max_effects=2))
    monkeypatch.setattr(engine, "add_second", lambda *_: pytest.fail("a second effect was sought"))
    assert len(engine.run().best.effects) <= 1
