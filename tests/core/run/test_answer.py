from dataclasses import replace

import numpy as np
from bsa.core.comparison.residuals import noise_of_residuals
from bsa.core.comparison.signal_metrics import SignalMetrics
from bsa.core.feedback import Feedback
from bsa.core.parameters import Candidate, Parameter, ParameterSpace
from bsa.core.rms import rms
from bsa.core.run.answer import answer
from bsa.core.task import Task
from bsa.core.trial import Trial
from bsa.testing.sample_task import sample_task


def trial(index: int, objective: float, misfit: float, candidate: Candidate | None = None) -> Trial:
    return Trial(
        index,
        "search",
        index,
        sample_task().space.initial if candidate is None else candidate,
        SignalMetrics(objective, {}),
        None,
        np.array([misfit, -misfit]),
        Feedback({}),
        (),
        0.0,
    )


def noisy_task(by_protocol: bool) -> Task:
    task = sample_task()
    experiment = task.experiments[0]
    noise = 2e-3 * np.random.default_rng(0).normal(size=len(experiment.target))
    record = experiment.target.changed(voltage=experiment.target.voltage + noise)
    steps = ("Rest for 1 minute", "Discharge at 2 A for 10 minutes", "Rest for 4 minutes")
    protocol = (steps,) if by_protocol else None
    return replace(task, experiments=(replace(experiment, target=record, protocol=protocol),))


def test_near_the_noise_the_likeliest_is_the_answer() -> None:
    task = noisy_task(by_protocol=True)
    noise = rms(noise_of_residuals(task))
    assert answer(task, [trial(0, 2.0, 1.1 * noise), trial(1, 1.0, 1.2 * noise)]).index == 0


def test_far_from_the_noise_of_a_protocol_the_score_counts_too() -> None:
    # A charge that is cut short: nearer point by point, and a hundred percent off on one clock.
    short, whole = trial(0, 96.0, 35.0), trial(1, 1.6, 44.0)
    assert answer(noisy_task(by_protocol=True), [short, whole]) is whole
    # A step that vanished: the score owes its value to that.
    assert answer(noisy_task(by_protocol=True), [trial(0, 1.5, 400.0), whole]) is whole
    assert answer(noisy_task(by_protocol=False), [short, whole]) is short


def test_under_a_measured_current_the_priors_count() -> None:
    task = noisy_task(by_protocol=False)
    known = tuple(replace(parameter, deviation=0.1, prior=True) for parameter in task.space)
    task = replace(task, space=ParameterSpace(known))
    far = {parameter.name: parameter.at_coordinate(3.0) for parameter in known}
    near, little_better, better = trial(0, 1.0, 10.0), trial(1, 0.9, 9.0, far), trial(2, 0.1, 1e-2, far)
    assert answer(task, [near, little_better]) is near
    assert answer(replace(task, space=sample_task().space), [near, little_better]) is little_better
    # Two residuals below a tolerance tell no more than a tolerance does.
    assert answer(task, [trial(0, 1.0, 1.0), better]).index == 0


def test_parameters_of_an_effect_that_was_added_have_to_be_worth_it() -> None:
    task = noisy_task(by_protocol=False)
    strength = Parameter("extra", 0.0, 0.0, 1.0, deviation=0.1)
    task = replace(
        task,
        cell=replace(task.cell, effects=("extra",), offered={"extra": ("extra",)}),
        space=ParameterSpace((*task.space, strength)),
    )
    without, it_has = {**sample_task().space.initial, "extra": 0.0}, {**sample_task().space.initial, "extra": 0.1}
    # Two residuals: minus twice the logarithm of the density falls by 4 ln(ratio), one parameter counts ln 2.
    worth = 2.0**0.25
    enough, too_little = trial(1, 1.0, 10.0 / (1.01 * worth), it_has), trial(2, 1.0, 10.0 / (0.99 * worth), it_has)
    assert answer(task, [trial(0, 1.0, 10.0, without), enough]) is enough
    assert answer(task, [trial(0, 1.0, 10.0, without), too_little]).index == 0


def test_where_nothing_ran_to_its_end_the_first_stands() -> None:
    failed = [replace(trial(number, 1.0, 1.0), metrics=None, residuals=None) for number in range(2)]
    assert answer(noisy_task(by_protocol=True), failed) is failed[0]
