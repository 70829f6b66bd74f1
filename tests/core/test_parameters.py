import numpy as np
import pytest
from bsa.core.encoding import decode_parameter, encode_parameter
from bsa.core.errors import BsaError
from bsa.core.parameters import Parameter, ParameterSpace, Scale
from bsa.core.prior import Prior
from hypothesis import given
from hypothesis import strategies as st

RADIUS = "Negative particle radius [m]"


@st.composite
def parameters(draw: st.DrawFn) -> Parameter:
    scale = draw(st.sampled_from(["linear", "log"]))
    lower = draw(st.floats(1e-12, 1e3))
    upper = lower * draw(st.floats(1.01, 1e4))
    share = draw(st.floats(0, 1))
    return Parameter("x [m]", min(max(lower + share * (upper - lower), lower), upper), lower, upper, scale)


@given(parameters(), st.floats(0, 1))
def test_unit_position_survives_a_round_trip(parameter: Parameter, position: float) -> None:
    value = parameter.from_unit(position)
    assert parameter.lower <= value <= parameter.upper
    assert parameter.to_unit(value) == pytest.approx(position, abs=1e-9)


@given(parameters(), st.floats(allow_nan=False, allow_infinity=False))
def test_projection_stays_inside_and_is_idempotent(parameter: Parameter, value: float) -> None:
    projected = parameter.project(value)
    assert parameter.lower <= projected <= parameter.upper
    assert parameter.project(projected) == projected


@given(parameters(), st.floats(-3, 4))
def test_points_outside_the_unit_box_are_projected(parameter: Parameter, position: float) -> None:
    assert parameter.lower <= parameter.from_unit(position) <= parameter.upper


@pytest.mark.parametrize("scale", ["linear", "log"])
@pytest.mark.parametrize(
    ("place", "bound"),
    [(0.0, "lower"), (0.0009, "lower"), (0.0011, ""), (0.5, ""), (0.9989, ""), (0.9991, "upper"), (1.0, "upper")],
)
def test_a_value_within_a_thousandth_of_the_range_is_at_a_bound(scale: Scale, place: float, bound: str) -> None:
    parameter = Parameter("p", 1.0, 0.5, 2.0, scale)
    assert parameter.bound_at(parameter.from_unit(place)) == bound


def test_log_scale_makes_equal_factors_equal_steps() -> None:
    parameter = Parameter(RADIUS, 1e-6, 1e-7, 1e-5, "log")
    assert parameter.to_unit(1e-6) == pytest.approx(0.5)
    assert parameter.unit == "m"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"lower": 2.0, "upper": 1.0}, "lower < upper must hold, but got (lower=2, upper=1)"),
        ({"initial": 5.0}, "the initial value 5 lies outside [0.1, 2]"),
        ({"upper": float("nan")}, "must be finite"),
        ({"lower": -1.0, "scale": "log"}, "a log scale needs lower > 0"),
    ],
)
def test_impossible_parameters_are_refused(changes: dict[str, object], words: str) -> None:
    valid = {"name": RADIUS, "initial": 1.0, "lower": 0.1, "upper": 2.0, "scale": "linear"}
    with pytest.raises(BsaError) as caught:
        Parameter(**{**valid, **changes})  # type: ignore[arg-type]
    assert words in str(caught.value)


def test_a_mistyped_name_is_met_with_the_nearest() -> None:
    space = ParameterSpace((Parameter(RADIUS, 1.0, 0.5, 2.0),))
    with pytest.raises(BsaError, match=r'did you mean "Negative particle radius \[m\]"'):
        space["Negative particle radius"]


def test_a_space_keeps_its_order_and_samples_inside() -> None:
    space = ParameterSpace((Parameter("b [m]", 1.0, 0.5, 2.0), Parameter("a [m]", 1.0, 0.5, 2.0, "log")))
    assert space.names == ("b [m]", "a [m]")
    sample = space.sample(np.random.default_rng(0))
    assert space.project(sample) == sample
    assert np.allclose(space.to_unit(space.initial), [1 / 3, 0.5])


def test_a_parameter_cannot_stand_twice() -> None:
    with pytest.raises(BsaError, match="stands twice"):
        ParameterSpace((Parameter("a [m]", 1.0, 0.5, 2.0),) * 2)


def test_a_search_that_is_continued_knows_no_more_than_the_first_one_did() -> None:
    """Prior 1.0 with deviation 0.1 and data that say 1.5 with deviation 0.1 meet at 1.25, however often."""
    space = ParameterSpace(
        (
            Parameter("known", 1.0, 0.0, 3.0, deviation=0.1, prior=True),
            Parameter("free", 1.0, 0.5, 2.0, "log", deviation=0.2),
        )
    )
    for _ in range(3):
        known, free = space
        there = known.coordinate(1.5) / 2.0
        found = {"known": known.at_coordinate(there), "free": free.at_coordinate(1.0)}
        assert found["known"] == pytest.approx(1.25)
        space = space.continued(found)
        assert space.initial == found
        assert Prior.of(space).centre[0] == pytest.approx(1.0 / 3.0)
        decoded = tuple(decode_parameter(encode_parameter(parameter)) for parameter in space)
        assert decoded == space.parameters
    assert "expected" not in encode_parameter(free)
