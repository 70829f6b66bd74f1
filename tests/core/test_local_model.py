import numpy as np
import pytest
from bsa.core.local_model import LocalModel
from hypothesis import given, settings
from hypothesis import strategies as st


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_a_bend_along_weak_directions_is_found_exactly(seed: int) -> None:
    rng = np.random.default_rng(seed)
    strong, weak = np.linalg.qr(rng.normal(size=(2, 2)))[0]
    slope, bend = rng.normal(size=(20, 2)), rng.normal(size=20)

    def residual(x: np.ndarray) -> np.ndarray:
        moved = x - centre
        return 100 * slope[:, 0] * (moved @ strong) + 0.5 * slope[:, 1] * (moved @ weak) + bend * (moved @ weak) ** 2

    centre = rng.uniform(0.3, 0.7, 2)
    jacobian = np.outer(100 * slope[:, 0], strong) + np.outer(0.5 * slope[:, 1], weak)
    model = LocalModel.straight(centre, residual(centre), jacobian)
    probes = model.probes()
    assert {len(probes)} <= {1, 2}
    found = model.with_curvature(probes, [residual(centre + step * direction) for direction, step in probes])
    place = centre + 0.1 * weak
    assert found.residual_at(place) == pytest.approx(residual(place), abs=0.02 * np.max(np.abs(bend)))


def test_probes_stay_inside_the_box_and_what_is_known_needs_none() -> None:
    corner = LocalModel.straight(np.array([0.01, 0.99]), np.zeros(5), np.zeros((5, 2)))
    for direction, step in corner.probes():
        assert np.all(corner.centre + step * direction >= 0.0)
        assert np.all(corner.centre + step * direction <= 1.0)
    known = LocalModel.straight(np.array([0.5, 0.5]), np.zeros(5), 1e3 * np.eye(5, 2))
    assert known.probes() == []


def test_probes_that_fail_leave_the_model_straight() -> None:
    model = LocalModel.straight(np.array([0.5]), np.zeros(3), np.ones((3, 1)))
    probes = model.probes()
    assert len(probes) == 2
    assert model.with_curvature(probes, [None, None]) is model
    one_sided = model.with_curvature(probes, [0.2 * np.ones(3), None])
    assert one_sided.curvature.shape == (1, 3)
