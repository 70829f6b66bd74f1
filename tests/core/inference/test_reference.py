"""What a base model lacks of an earlier record is taken off a later one of the same test."""

from dataclasses import replace

import discovery_toy as toy
import numpy as np
import pytest
from bsa.core.contracts.requests import Request
from bsa.core.errors import BsaError
from bsa.core.inference.observations import observe
from bsa.core.inference.reference import _phases, check_tests, without_known

CYCLE = ((0, 60), (1, 900), (0, 400), (-1, 900), (0, 300))


def seen(name, truth, seed, program=CYCLE):
    return observe(toy.measured_record(name, np.random.default_rng(seed), truth, program=program), points=150)


def less(observed, *references):
    candidate = {"resistance factor": 1.2, observed.measured_record.soc_name: 0.9}
    (found,) = without_known(toy.ToySimulator(), [observed], references, candidate)
    return found


def left(observed):
    """What the toy lacks of a record, V."""
    asked = Request((), {"resistance factor": 1.2}, observed.measured_record, observed.moments, soc=0.9)
    return observed.voltage - toy.ToySimulator().one(asked).voltage


def test_only_what_has_changed_is_left():
    later = seen("later", {"slow": 0.03, "sign": 0.01}, 1)
    found = less(later, seen("earlier", {"slow": 0.03}, 2))
    assert np.sqrt(np.mean(left(later) ** 2)) > 0.015
    sign = -0.01 * np.sign(later.current)
    assert np.sqrt(np.mean((left(found) - sign) ** 2)) < 1.5e-3
    assert np.all(found.sigma >= later.sigma)
    assert np.max(found.sigma) > 5e-3


def test_the_end_of_a_discharge_corresponds_to_that_of_a_longer_one():
    shorter = ((0, 60), (1, 800), (0, 400), (-1, 800), (0, 300))
    found = less(seen("later", {"slow": 0.03}, 1, shorter), seen("earlier", {"slow": 0.03}, 2))
    assert np.sqrt(np.mean(left(found) ** 2)) < 2.5e-3


def test_a_rest_with_an_offset_of_the_current_is_a_rest():
    """A rest with 3 % of the current was a charge, and the record had another number of them than its reference."""
    later, earlier = seen("later", {"slow": 0.03}, 1), seen("earlier", {"slow": 0.03}, 2)
    found = less(replace(later, current=later.current - 0.03), earlier)
    np.testing.assert_array_equal(found.voltage, less(later, earlier).voltage)


@pytest.mark.parametrize("offset", [0.0, 0.03, -0.03])
def test_a_charge_and_its_hold_are_one_and_the_rest_behind_them_another(offset):
    """A hold ends at a twentieth of the current: by the size of that jump the rest behind it had been a part of it."""
    program = ((0, 60), (-1, 300), (-0.3, 200), (-0.045, 200), (0, 400), (1, 900), (0, 300))
    observed = seen("a", {}, 1, program)
    phases = _phases(replace(observed, current=observed.current + offset))
    of_steps = [set(phases[observed.step == number]) for number in range(len(program))]
    assert of_steps == [{0}, {1}, {1}, {1}, {2}, {3}, {4}]


def test_a_reference_of_another_test_is_refused():
    other = ((0, 60), (1, 900), (0, 300))
    with pytest.raises(BsaError, match="later has 5 charges, discharges and rests, and its reference earlier 3"):
        check_tests([seen("later", {}, 1)], [seen("before", {}, 3), seen("earlier", {}, 2, other)])


def test_what_is_uncertain_is_a_quarter_and_how_far_references_differ():
    later, earlier = seen("later", {"slow": 0.03}, 1), seen("earlier", {"slow": 0.03}, 2)
    once, twice = less(later, earlier), less(later, earlier, earlier)
    np.testing.assert_allclose(once.systematic[:, 0], 0.25 * (later.voltage - once.voltage))
    np.testing.assert_allclose(twice.systematic[:, 1:], 0.0, atol=1e-12)
    np.testing.assert_allclose(twice.sigma, once.sigma)
    other = less(later, earlier, seen("other", {"slow": 0.03, "sign": 0.02}, 3))
    assert other.systematic.shape == (len(later), 3)
    charged = np.abs(later.current) > 0.5
    # 20 mV apart: each 10 mV from the mean, which is as uncertain as a half of that.
    apart = np.linalg.norm(other.systematic[:, 1:], axis=1)[charged]
    assert np.median(apart) == pytest.approx(np.sqrt(1.5) * np.sqrt(2.0) * 0.01, rel=0.1)
    assert np.all(other.sigma[charged] > twice.sigma[charged])


def test_references_go_round_by_record():
    """A first one for each record, then a second one: the third reference is the first record's."""
    first, second = seen("first", {"slow": 0.03}, 1), seen("second", {"sign": 0.03}, 2)
    known = {"slow": 0.03}, {"sign": 0.03}
    references = [seen(f"reference {k}", known[k % 2], 3 + k) for k in range(4)]
    candidate = {"resistance factor": 1.2} | {one.measured_record.soc_name: 0.9 for one in (first, second)}
    found = without_known(toy.ToySimulator(), [first, second], references, candidate)
    for observed in found:
        assert np.sqrt(np.mean(left(observed) ** 2)) < 2e-3
