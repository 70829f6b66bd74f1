import numpy as np
from bsa.plugins.pybamm.solving.output_times import output_times
from hypothesis import given
from hypothesis import strategies as st


@given(
    stops=st.lists(st.floats(0.0, 1e5), min_size=2, max_size=6, unique=True).map(sorted),
    wanted=st.lists(st.floats(0.0, 1.0), max_size=40),
    flows=st.booleans(),
)
def test_stops_are_kept_and_nothing_is_invented(stops, wanted, flows):
    stops = np.array(stops)
    times = np.sort(stops[0] + np.array(wanted) * np.ptp(stops))
    kept = output_times(times, stops, np.full(len(stops) - 1, flows))
    assert np.all(np.diff(kept) > 0)
    assert set(stops) <= set(kept)
    assert set(kept) <= {*stops, *times}


def test_a_slow_record_keeps_its_samples():
    times = np.arange(0.0, 3601.0, 10.0)
    assert len(output_times(times, times[[0, -1]], np.array([True]))) == len(times)


def test_what_relaxes_over_decades_is_straight_between_few_times_of_a_rest():
    times = np.arange(0.0, 7200.0, 0.1)
    kept = output_times(times, times[[0, -1]], np.array([False]))
    assert len(kept) < 200
    relaxing = 0.05 * np.log10(1.0 + times)  # 50 mV by decade
    assert np.max(np.abs(np.interp(times, kept, 0.05 * np.log10(1.0 + kept)) - relaxing)) < 2e-5


def test_where_current_flows_a_second_is_the_longest():
    times = np.arange(0.0, 3600.0, 0.1)
    kept = output_times(times, times[[0, -1]], np.array([True]))
    assert np.max(np.diff(kept)) < 1.2
    assert len(kept) < len(times) / 8
