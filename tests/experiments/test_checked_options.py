"""What a person said of files is refused in the words that were typed."""

from __future__ import annotations

import bsa
import numpy as np
import pandas as pd
import pytest
from bsa.core.errors import BsaError
from bsa.experiments.checked_options import as_names, as_numbers, simulation_workers
from bsa.experiments.read_options import reading, readings


@pytest.mark.parametrize(
    ("said", "message", "hint"),
    [
        ({"temperature": 298}, "--temperature is 298: it is in degC", "298 K are 24.85 degC"),
        ({"temperature": -300}, "--temperature is -300", "in degC"),
        ({"temperature": "hot"}, "--temperature is 'hot', which is no number", "give a number"),
        ({"constant_current": "much"}, "--constant-current is 'much'", "give a number"),
        ({"voltage_lag": [None]}, "--voltage-lag is None", "give a number"),
        ({"column": {"volt": "U"}}, '--column volt=U: there is no signal "volt"', "Signals: time, voltage, current"),
        ({"column": {"frequncy": "f"}}, 'there is no signal "frequncy"', 'did you mean "frequency"? Signals: time'),
        ({"unit": {"frequency": "Hz"}}, 'there is no signal "frequency"', "Signals: time, voltage, current"),
        ({"column": "voltage=U"}, "--column is 'voltage=U', which has no keys", "give a mapping, {'voltage': 'U'}"),
        ({"where": ["cell=1"]}, "--where is ['cell=1'], which has no keys", "give a mapping, {'cell': '1'}"),
        ({"unit": "mA"}, "--unit is 'mA', which has no keys", "give a mapping, {'KEY': 'VALUE'}"),
        ({"unit": {"curent": "A"}}, '--unit curent=A: there is no signal "curent"', 'did you mean "current"? Signals'),
    ],
)
def test_the_option_is_named_as_it_was_said(said, message, hint):
    with pytest.raises(BsaError) as found:
        readings(**said)
    assert message in found.value.message
    assert hint in found.value.hint


def test_one_number_several_or_none():
    assert as_numbers(None, "--x") == []
    assert as_numbers(np.float32(2.0), "--x") == [2.0]
    assert as_numbers(np.int64(2), "--x") == [2.0]
    assert as_numbers(np.arange(2), "--x") == [0.0, 1.0]
    assert as_numbers((1, "2"), "--x") == [1.0, 2.0]
    with pytest.raises(BsaError, match="--x is True"):
        as_numbers(True, "--x")


def test_one_name_is_a_list_of_one():
    assert as_names("heat", "--x") == ["heat"]
    assert as_names(("heat", "cracks"), "--x") == ["heat", "cracks"]
    assert as_names(None, "--x") == []
    with pytest.raises(BsaError, match="--x is 3, which is no name"):
        as_names(["heat", 3], "--x")


def test_a_number_of_each_record_is_checked_once(monkeypatch):
    checked = []
    monkeypatch.setattr("bsa.experiments.read_options.as_number", lambda value, option: checked.append(value) or value)
    assert [one.options.current_offset_a for one in readings(current_offset=[0.1, 0.2], voltage_lag=3.0)] == [0.1, 0.2]
    assert checked == [0.1, 0.2, 3.0]


def test_a_column_may_be_numbered():
    assert reading({"time": 0}).options.columns == {"time": "0"}
    time = np.arange(0.0, 1000.0, 10.0)
    frame = pd.DataFrame({0: time, 1: 4.0 - time / 5000, 2: np.full(100, -2.0)})
    record = bsa.read_record(frame, column={"time": 0, "voltage": 1, "current": 2})
    assert record.trajectory.voltage[0] == 4.0


@pytest.mark.parametrize("workers", ["a", -1, 1.5, True])
def test_workers_are_a_number_of_simulations(workers):
    with pytest.raises(BsaError, match="--workers is"):
        simulation_workers(workers)


def test_two_workers_are_two():
    assert simulation_workers(np.int64(2)) == 2
    assert simulation_workers(0) >= 1
