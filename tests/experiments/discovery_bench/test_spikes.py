"""What is hidden in a measured record is what the same instruments would have shown."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from bsa.core.segmentation import segment
from bsa.core.trajectory import Trajectory
from bsa.experiments.discovery_bench import spikes
from bsa.experiments.discovery_bench.hidden_physics import EFFECTS, OUTSIDE
from bsa.experiments.discovery_bench.spikes import Spike, draw_spike, spiked

CAPACITY_AH = 2.0
BY_KEY = {effect.key: effect for effect in EFFECTS}


@pytest.fixture(scope="module")
def cycle() -> Trajectory:
    """A rest, an hour of discharge and half an hour of charge, at 2 A, with a sample every ten seconds."""
    time = np.arange(0.0, 6000.0, 10.0)
    current = np.select([time < 300, time < 3900, time < 4200, time < 6000], [0.0, 2.0, 0.0, -2.0])
    return segment(Trajectory(time, current, 3.9 - 0.5 * np.cumsum(current) * 10 / 3600 / CAPACITY_AH))


def with_effect(cycle: Trajectory, key: str, strength: float) -> Trajectory:
    return spiked(cycle, Spike("single", (BY_KEY[key],), {key: strength}), CAPACITY_AH)


def test_a_resistance_takes_its_drop_off_the_voltage_and_leaves_the_current(cycle: Trajectory) -> None:
    found = with_effect(cycle, "contact-resistance", 0.01)
    np.testing.assert_allclose(cycle.voltage - found.voltage, 0.01 * cycle.current, atol=1e-12)
    np.testing.assert_array_equal(found.current, cycle.current)


@pytest.mark.parametrize(
    ("key", "strength", "current", "voltage"),
    [
        ("self-discharge", 0.05, lambda i: i - 0.05, lambda v: v),
        ("current-offset", -0.05, lambda i: i + 0.05, lambda v: v),
        ("current-gain", 1.25, lambda i: i / 1.25, lambda v: v),
        ("voltage-offset", 0.02, lambda i: i, lambda v: v + 0.02),
    ],
)
def test_instruments_write_down_what_they_see(cycle: Trajectory, key, strength, current, voltage) -> None:
    found = with_effect(cycle, key, strength)
    np.testing.assert_allclose(found.current, current(cycle.current), atol=1e-12)
    np.testing.assert_allclose(found.voltage, voltage(cycle.voltage), atol=1e-12)


def test_a_late_voltage_is_that_of_before(cycle: Trajectory) -> None:
    found = with_effect(cycle, "time-lag", 20.0)
    np.testing.assert_allclose(found.voltage[50:], cycle.voltage[48:-2], atol=1e-4)


def test_a_hysteresis_ends_at_its_half_gap_on_either_side(cycle: Trajectory) -> None:
    added = with_effect(cycle, "ocp-hysteresis", 0.03).voltage - cycle.voltage
    assert added[0] == 0.0
    assert added[389] == pytest.approx(-0.03, abs=1e-3)
    assert added[-1] == pytest.approx(0.03, abs=1e-3)


@pytest.mark.parametrize("name", sorted(OUTSIDE.keys() - {"soc-dependent-resistance"}))
def test_what_no_catalogue_has_goes_with_its_strength(cycle: Trajectory, name: str) -> None:
    added = [
        spiked(cycle, Spike("outside", outside=name, outside_strength=strength), CAPACITY_AH).voltage - cycle.voltage
        for strength in (0.01, 0.02)
    ]
    assert np.ptp(added[0]) > 1e-3
    np.testing.assert_allclose(added[1], 2 * added[0], atol=1e-12)


def test_everything_is_drawn_and_a_seed_draws_it_again(cycle: Trajectory) -> None:
    drawn = [draw_spike(5, number, 0, [cycle], CAPACITY_AH) for number in range(60)]
    assert drawn == [draw_spike(5, number, 0, [cycle], CAPACITY_AH) for number in range(60)]
    assert {one.setting for one in drawn} == {"single", "pair", "none", "outside"}
    singles = [one for one in drawn if one.setting == "single"]
    assert {one.effects[0].key for one in singles} == {effect.key for effect in spikes._SPIKES}
    assert all(not one.effects and not one.outside for one in drawn if one.setting == "none")
    assert all(one.outside_strength > 0 for one in drawn if one.setting == "outside")


def test_discharges_alone_show_no_hysteresis(cycle: Trajectory) -> None:
    discharge = cycle.changed(current=np.maximum(cycle.current, 0.0))
    keys = {
        effect.key for number in range(200) for effect in draw_spike(5, number, 0, [discharge], CAPACITY_AH).effects
    }
    assert keys == {effect.key for effect in spikes._SPIKES} - {"ocp-hysteresis"}


def test_nothing_is_taken_from_what_is_tested() -> None:
    tree = ast.parse(Path(spikes.__file__).read_text())
    imported = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert imported <= {"collections.abc", "dataclasses", "core.trajectory", "draws", "hidden_physics"}
