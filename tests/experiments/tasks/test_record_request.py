"""A record in parts: what was said of its start goes with the part that begins there."""

import numpy as np
import pytest
from bsa.core.record import Record
from bsa.core.segmentation import segment
from bsa.core.trajectory import Trajectory
from bsa.experiments.tasks.record_request import RecordRequest


@pytest.mark.parametrize(("first", "socs"), [(200, [0.9, None]), (2, [None])])
def test_a_state_of_charge_that_was_said_is_that_of_the_start(first: int, socs: list[float | None]) -> None:
    time = np.concatenate([10.0 * np.arange(first), 20_000.0 + 10.0 * np.arange(200)])
    current = np.concatenate([np.full(first, 1.0), np.repeat([0.0, 1.0], 100)])
    record = Record("r", segment(Trajectory(time, current, np.full(len(time), 3.7))))
    assert [part.initial_soc for part in RecordRequest(record, initial_soc=0.9).parts()] == socs
