import json

import numpy as np
from bsa.core.numbers import json_ready


def test_what_json_cannot_say_is_none_and_numbers_of_numpy_are_pythons() -> None:
    content = {1: [np.float64(0.5), float("inf"), np.int64(3)], "a": (np.bool_(True), None, "b", np.float32("nan"))}
    ready = json_ready(content)
    assert json.dumps(ready, allow_nan=False) == '{"1": [0.5, null, 3], "a": [true, null, "b", null]}'


def test_floats_alone_are_rounded() -> None:
    assert json_ready([1.23456, 123456, np.float32(0.1), True], 3) == [1.23, 123456, 0.1, True]
