from dataclasses import replace

import discovery_toy as toy
import numpy as np
import pytest
from bsa.core.contracts.requests import MeasuredRecord
from bsa.core.discovery.localisation import in_words, localise
from bsa.core.inference.observations import observe
from bsa.core.trajectory import Step, StepKind, Trajectory


def observed():
    rng = np.random.default_rng(0)
    measured_record = toy.measured_record("a", rng, {})
    return observe(replace(measured_record, ambient_k=298.15), 150)


def test_an_error_under_load_is_found_under_load():
    o = observed()
    error = np.where(o.current > 2.0, 0.02, 0.0)
    places = localise([o], [error], 1.0)
    by_segment = {p.where: p for p in places if p.by == "segment"}
    worst = max(by_segment.values(), key=lambda p: p.share)
    assert "2.5C" in worst.where
    assert worst.bias_mv == pytest.approx(-20.0, rel=0.01)  # simulated minus measured
    assert worst.z < 0
    for by in ("segment", "rate", "charge", "since step", "temperature"):
        assert sum(p.share for p in places if p.by == by) == pytest.approx(1.0, abs=1e-6)
    sentences = in_words(places, 1e-3)
    assert sentences[0].startswith(
        "The measured voltage lies on average 20.0 mV above the model during a: CC discharge at 2.5C"
    )
    (by_rate,) = (sentence for sentence in sentences if sentence.startswith("By rate, the largest error: "))
    assert "(15.5 mV rms, simulated minus measured on average -11.4 mV)" in by_rate
    assert any(sentence.startswith("By time since the last step, ") for sentence in sentences)


@pytest.mark.parametrize("dense", [False, True])
def test_the_rate_of_a_step_is_its_mean_over_time(dense):
    """Samples and averages are closer together at the beginning of a hold, where its current is largest."""
    time = 3600.0 * np.linspace(0.0, 1.0, 720) ** (3.0 if dense else 1.0)
    fading = Trajectory(time, -np.exp(-time / 600.0), np.full(len(time), 4.2), None, (Step(StepKind.CV_HOLD, 0, 720),))
    o = observe(MeasuredRecord("a", fading, 298.15), 150)
    places = localise([o], [np.full(len(o), 0.01)], 1.0)
    (segment,) = (place.where for place in places if place.by == "segment")
    assert segment == "a: CV hold at 0.17C"
    assert abs(np.mean(o.current)) > 0.3


def test_a_very_high_rate_is_no_rest():
    o = observed()
    places = localise([o], [np.zeros(len(o))], 0.01)
    rates = {place.where for place in places if place.by == "rate"}
    assert rates == {"rest", "discharge over 1.5C", "charge over 1.5C"}
    (rest,) = (place for place in places if place.where == "rest")
    assert rest.samples == np.count_nonzero(o.current == 0.0)


def test_a_record_without_a_temperature_is_at_none_beside_one_that_has_it():
    o = observed()
    unknown = replace(o, measured_record=replace(o.measured_record, name="b", ambient_k=None))
    places = localise([o, unknown], [np.zeros(len(o))] * 2, 1.0)
    where = {place.where: place.samples for place in places if place.by == "temperature"}
    assert where == {"20 to 30 degC": len(o), "not known": len(o)}
    assert not any(place.by == "temperature" for place in localise([unknown], [np.zeros(len(o))], 1.0))


def test_averages_keep_every_sample_and_the_noise():
    o = observed()
    rng = np.random.default_rng(0)
    record = toy.measured_record("a", rng, {}).record
    assert o.count.sum() == len(record)
    assert np.all(np.diff(o.time) > 0)
    assert o.noise == pytest.approx(1e-3, rel=0.25)


def test_two_samples_with_one_stamp_stand_on_either_side_of_the_jump():
    time = np.array([0.0, 10.0, 20.0, 30.0, 30.0, 40.0, 50.0])
    current = np.array([0.0, 0, 0, 0, 2, 2, 2])
    steps = (Step(StepKind.REST, 0, 4), Step(StepKind.CC_DISCHARGE, 4, 7))
    o = observe(MeasuredRecord("a", Trajectory(time, current, 4.0 - 0.1 * current, None, steps)))
    assert o.time[3] == 30.0
    assert o.time[4] > 30.0
