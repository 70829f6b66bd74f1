import numpy as np
from bsa.core.thinning import evenly, where_they_bend


def test_both_ends_and_the_knee_of_a_discharge_are_kept() -> None:
    """An even sample of 60 would draw a straight line over the last two minutes of two hours."""
    time = np.linspace(0.0, 7309.0, 3000)
    voltage = 4.2 - 0.3 * time / 7309 - 0.8 * np.exp((time - 7309.0) / 200.0)
    current = np.where(time > 7306.0, 0.0, 1.0)
    kept = where_they_bend(time, [voltage, current], 60)
    assert len(kept) == 60
    assert np.all(np.diff(kept) > 0)
    assert (kept[0], kept[-1]) == (0, 2999)

    def off(places: np.ndarray) -> float:
        return float(np.max(np.abs(np.interp(time, time[places], voltage[places]) - voltage)))

    assert off(kept) < 1e-3 < 0.02 < off(evenly(3000, 60))
    assert current[kept[current[kept] > 0][-1] + 1] == 0.0  # the last sample before the current stops is there


def test_straight_lines_need_no_more_than_an_even_sample_and_few_samples_are_all_kept() -> None:
    time = np.arange(1000.0)
    assert np.array_equal(where_they_bend(time, [time / 999], 60), evenly(1000, 30))
    assert np.array_equal(where_they_bend(time[:50], [(time[:50] / 49) ** 2], 60), np.arange(50))
    assert np.array_equal(where_they_bend(time, [], 2), [0, 999])
