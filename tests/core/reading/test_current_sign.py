"""Which way a current flows, and records whose current cannot tell."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.current_sign import with_sign
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions

SIGNS = ("charge-positive", "discharge-positive", "auto")


def samples(*stretches: tuple[float, float, float], gap_after: int | None = None) -> Samples:
    """Fifty samples, one a minute, of each stretch: its current, its first voltage and its last one."""
    time = 60.0 * np.arange(50 * len(stretches))
    if gap_after is not None:
        time[50 * gap_after :] += 20_000.0
    return Samples(
        "s",
        time=time,
        voltage=np.concatenate([np.linspace(first, last, 50) for _, first, last in stretches]),
        current=np.repeat([current for current, _, _ in stretches], 50),
    )


DISCHARGE, REST, CHARGE = (2.5, 4.1, 2.5), (0.0, 3.0, 3.1), (1.7, 3.2, 4.2)


@pytest.mark.parametrize("sign", SIGNS)
@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_two_discharges_and_a_charge_of_one_sign_are_refused_whatever_is_said(sign: Any, turn: float) -> None:
    read = samples(DISCHARGE, REST, CHARGE, (0.0, 4.2, 4.1), DISCHARGE)
    read = Samples("s", time=read.time, voltage=read.voltage, current=turn * read.current)
    message = r"falls from 4\.067 V \(row 2\) to 2\.5 V \(row 50\) and rises from 3\.22 V \(row 102\) to 4\.2 V"
    with pytest.raises(BsaError, match=message) as raised:
        with_sign(read, ReadOptions(current_sign=sign))
    assert raised.value.hint.startswith("the file gives sizes only: export the current with its sign, or a column")


@pytest.mark.parametrize(
    "read",
    [
        pytest.param(samples((2.5, 3.0, 2.5), (2.5, 4.1, 3.8), (0.0, 4.0, 4.1), DISCHARGE, gap_after=1), id="a gap"),
        pytest.param(samples(DISCHARGE, (0.2, 2.9, 3.3), (0.2, 3.3, 2.5)), id="recovers against a small load"),
        pytest.param(samples((0.1, 4.2, 4.1), (5.0, 3.9, 3.0), (0.1, 3.6, 3.65)), id="the load becomes smaller"),
        pytest.param(samples(DISCHARGE, (0.0, 2.5, 3.2)), id="rests"),
    ],
)
def test_a_discharge_alone_has_one_sign(read: Samples) -> None:
    assert with_sign(read, ReadOptions(current_sign="auto")).current[0] > 0.0
    with pytest.raises(BsaError, match="so it is not charge-positive"):
        with_sign(read, ReadOptions())


@pytest.mark.parametrize(
    ("stated", "said", "hint"),
    [
        ("charge-positive", 2.5, "give --constant-current=-2.5: a discharge is negative there."),
        ("discharge-positive", -2.5, "give --constant-current=2.5: a discharge is positive there."),
    ],
)
def test_a_constant_current_of_the_wrong_sign_is_that_of_the_option(stated: Any, said: float, hint: str) -> None:
    read = samples((said, 4.1, 2.5))
    with pytest.raises(BsaError, match=r"the current of --constant-current is -?2\.5 A while the voltage") as raised:
        with_sign(read, ReadOptions(current_sign=stated, constant_current_a=said))
    assert raised.value.hint == hint
    with pytest.raises(BsaError, match='column "I" is'):
        with_sign(replace(read, names={"current": "I"}), ReadOptions(current_sign=stated, constant_current_a=said))


def test_noise_of_an_instrument_at_rest_tells_no_sign() -> None:
    rng = np.random.default_rng(1)
    current = rng.normal(0.0, 2e-6, 100)
    read = replace(samples((0.0, 4.0390, 4.0435), (0.0, 4.0435, 4.0430)), current=current)
    read = replace(read, voltage=read.voltage - 300.0 * current)  # falls where the current rises
    np.testing.assert_array_equal(with_sign(read, ReadOptions()).current, -current)
