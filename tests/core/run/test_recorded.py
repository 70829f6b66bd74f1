import json

import discovery_toy as toy
import numpy as np
import pytest
from bsa.core.contracts.requests import LifeRequest, LifeResiduals, Moments, Prediction, Request
from bsa.core.discovery.engine import Engine
from bsa.core.run.journal import Journal, read_events
from bsa.core.run.recorded import RecordedSimulator

CATALOGUE = (toy.QUADRATIC, toy.HYSTERESIS)


class Counting(toy.ToySimulator):
    """Stops after so many simulations, as Ctrl-C would."""

    def __init__(self, most=10**9):
        self.most, self.asked, self.refused = most, 0, {}

    def predict(self, requests):
        self.asked += len(requests)
        if self.asked > self.most:
            raise KeyboardInterrupt
        return super().predict(requests)


def discover(folder, inner, listener=lambda text: None):
    journal = Journal(folder)
    try:
        earlier = list(read_events(folder))
        if not earlier:
            journal.append("run", format=1, kind="discovery")
        problem, space = toy.problem(np.random.default_rng(0), {"sign": 0.01})
        problem.simulator = RecordedSimulator(inner, Prediction, journal, earlier)
        return Engine(problem, space, CATALOGUE, toy.EVIDENCE, listener=listener).run()
    finally:
        journal.close()


def numbers(findings):
    return [(e.label, tuple(e.fit.u), e.rmse_v, e.held_rmse_v) for e in findings.explanations]


@pytest.mark.slow
def test_a_discovery_that_was_stopped_goes_on_where_it_was_and_finds_the_same(tmp_path):
    whole = Counting()
    wanted = discover(tmp_path / "whole", whole)
    with pytest.raises(KeyboardInterrupt):
        discover(tmp_path / "stopped", Counting(most=whole.asked // 2))
    done = sum(event["event"] == "simulation" for event in read_events(tmp_path / "stopped"))
    rest = Counting()
    found = discover(tmp_path / "stopped", rest)
    assert (found.verdict, found.reason, numbers(found)) == (wanted.verdict, wanted.reason, numbers(wanted))
    assert done > whole.asked // 4
    assert rest.asked <= whole.asked - done


@pytest.mark.slow
def test_a_discovery_that_is_done_simulates_nothing_again(tmp_path):
    first, again = [], []
    wanted = discover(tmp_path / "run", Counting(), first.append)
    assert numbers(discover(tmp_path / "run", Counting(most=0), again.append)) == numbers(wanted)
    # What a journal answers at once is no pace at which the rest would go on.
    (before,), (after,) = ([line for line in lines if "until these are compared" in line] for lines in (first, again))
    assert before.startswith(f"{after.removesuffix('; more may follow')}: about ")


def test_only_what_is_simulated_is_counted(tmp_path):
    counts = []
    journal = Journal(tmp_path)
    simulator = RecordedSimulator(Counting(), Prediction, journal, counted=counts.append)
    time = np.arange(3.0)
    record = toy.measured_record("x", np.random.default_rng(0), {})
    one, other = (Request((), {"a": size}, record, Moments.single(time, time)) for size in (1.0, 2.0))
    try:
        simulator._inner.predict = lambda requests: [None for _ in requests]
        simulator.predict([one])
        simulator.predict([one, other])
        simulator.predict([other])
    finally:
        journal.close()
    assert counts == [1, 1]


def test_what_fails_and_what_is_refused_stands_in_the_journal(tmp_path):
    class Failing(Counting):
        def predict(self, requests):
            self.refused = {"slow": "no such parameter"}
            return [None for _ in requests]

    time = np.arange(3.0)
    request = Request(
        (), {"a": 1.0}, toy.measured_record("x", np.random.default_rng(0), {}), Moments.single(time, time)
    )
    for number in range(2):
        journal = Journal(tmp_path)
        earlier = list(read_events(tmp_path))
        if not earlier:
            journal.append("run", format=1, kind="discovery")
        simulator = RecordedSimulator(Failing() if number == 0 else Counting(most=0), Prediction, journal, earlier)
        assert simulator.predict([request, request]) == [None, None]
        assert simulator.refused == {"slow": "no such parameter"}
        journal.close()
    kinds = [json.loads(line)["event"] for line in (tmp_path / "journal.jsonl").read_text().splitlines()]
    assert kinds == ["run", "simulation", "refused"]


@pytest.mark.parametrize("change", ["candidate", "soc", "fine", "effects"])
def test_requests_that_differ_are_not_taken_for_one_another(tmp_path, change):
    time = np.arange(3.0)
    measured_record, moments = toy.measured_record("x", np.random.default_rng(0), {}), Moments.single(time, time)
    first = Request((), {"resistance factor": 1.0, "sign: size [V]": 0.1}, measured_record, moments)
    other = {
        "candidate": Request((), {"resistance factor": 2.0, "sign: size [V]": 0.1}, measured_record, moments),
        "soc": Request((), first.candidate, measured_record, moments, soc=0.3),
        "fine": Request((), first.candidate, measured_record, moments, fine=True),
        "effects": Request((toy.HYSTERESIS,), first.candidate, measured_record, moments),
    }[change]
    journal = Journal(tmp_path)
    inner = Counting()
    simulator = RecordedSimulator(inner, Prediction, journal)
    simulator.predict([first, other, first])
    assert inner.asked == 2
    assert simulator.simulations == 3
    journal.close()


def test_lives_and_their_single_cycles_are_kept_too(tmp_path):
    class Life(Counting):
        def predict(self, requests):
            self.asked += len(requests)
            return [LifeResiduals(np.full(3, one.candidate["a"] + (one.cycle or 0))) for one in requests]

    requests = [LifeRequest((), {"a": 1.5}), LifeRequest((), {"a": 1.5}, 7), LifeRequest((toy.QUADRATIC,), {"a": 1.5})]
    for asked in (3, 0):
        journal, inner = Journal(tmp_path), Life()
        earlier = list(read_events(tmp_path))
        if not earlier:
            journal.append("run", format=1, kind="discovery")
        found = RecordedSimulator(inner, LifeResiduals, journal, earlier).predict(requests)
        assert [one.residual.tolist() for one in found] == [[1.5] * 3, [8.5] * 3, [1.5] * 3]
        assert inner.asked == asked
        journal.close()
