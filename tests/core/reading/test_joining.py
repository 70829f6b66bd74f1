"""Files of one cell become one record; where its charge is uncertain is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bsa.core.errors import BsaError
from bsa.core.reading.checks import to_record
from bsa.core.reading.joining import carried_on, joined
from bsa.core.reading.reading import read_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions
from bsa.core.trajectory import StepKind
from hypothesis import given, settings
from hypothesis import strategies as st

MARCH = 1_268_000_000.0
"""A day in March 2010."""


def cycle(source: str = "a", start: float | None = None, cycles: int = 1, leak: float = 0.0, **extra) -> Samples:
    """Charge, rest, discharge, rest of a 1 Ah cell at 1C, current positive on charge; the clock begins at 0."""
    t = np.arange(0.0, 9000.0, 30.0)
    once = np.where(t < 3600, 1.0, np.where((t >= 4500) & (t < 8100), -1.0 - leak, 0.0))
    i = np.tile(once, cycles)
    t = np.arange(len(i)) * 30.0
    v = 3.0 + 1.2 * np.clip(np.cumsum(np.tile(np.where(once < 0, -1.0, once), cycles)) / 120, 0, 1)
    columns = {"cycle": 1.0 + np.arange(len(i)) // len(once), **extra}
    if start is not None:
        columns["date"] = start + t
    return Samples(source, t, v, i, extra=columns)


def test_files_are_joined_by_their_dates_and_clocks_and_cycles_go_on():
    late, early = cycle("late", MARCH + 20_000.0), cycle("early", MARCH, cycles=2)
    whole = joined([late, early], "cell")
    assert whole.sheets == ("early", "late")
    assert np.all(np.diff(whole.time) > 0)
    assert whole.time[-1] == 20_000.0 + 8970.0
    record = to_record(whole, ReadOptions())
    assert record.trajectory.cycles == (1, 2, 3)
    assert '2 parts were joined by date: "early", "late".' in record.notes


@pytest.mark.parametrize(
    ("names", "order"),
    [
        (["CS2_35_10_1_10", "CS2_35_8_17_10"], [1, 0]),
        (["cell 2020-11-02", "cell 2020-02-11"], [1, 0]),
        (["03-11-17_10.10 b", "03-11-17_08.47 a"], [1, 0]),
        (["b", "a"], [0, 1]),
    ],
)
def test_files_without_dates_go_by_their_names_or_as_given(names, order):
    whole = joined([cycle(name) for name in names], "cell")
    assert whole.sheets == tuple(names[k] for k in order)
    assert whole.time[300] - whole.time[299] == 30.0


def test_files_that_alternate_are_merged():
    whole = cycle("all", MARCH)
    odd = np.arange(len(whole)) // 20 % 2 == 1
    merged = joined([whole.kept(odd), whole.kept(~odd)], "cell")
    np.testing.assert_array_equal(merged.time, whole.time)
    np.testing.assert_array_equal(merged.current, whole.current)


@given(st.lists(st.integers(1, 3), min_size=1, max_size=5), st.booleans())
@settings(max_examples=20, deadline=None)
def test_no_sample_is_lost_and_time_never_falls(cycles, dated):
    parts, start = [], MARCH
    for k, count in enumerate(cycles):
        parts.append(cycle(str(k), start if dated else None, count))
        start += 9000.0 * count + 500.0
    whole = joined(parts, "cell")
    assert len(whole) == sum(len(part) for part in parts)
    assert np.all(np.diff(whole.time) > 0)
    assert to_record(whole, ReadOptions()).trajectory.cycles == tuple(range(1, sum(cycles) + 1))


def write(path, samples: Samples, header: str = "cycle,time_s,current_A,voltage_V") -> None:
    rows = zip(samples.extra["cycle"], samples.time, samples.current, samples.voltage, strict=True)
    path.write_text("\n".join([header, *(",".join(map(repr, map(float, row))) for row in rows)]))


def test_a_folder_and_a_list_of_files_are_one_cell(tmp_path):
    for day in (3, 1, 2):
        write(tmp_path / f"cell_3_{day}_10.csv", cycle())
    files = sorted(tmp_path.iterdir())
    for name in (".DS_Store", "~$cell_3_1_10.xlsx"):  # of the system, and of a spreadsheet while a file is open
        (tmp_path / name).write_bytes(b"\0")
    record = read_record(tmp_path)
    assert record.name == tmp_path.name
    assert record.trajectory.cycles == (1, 2, 3)
    several = read_record(files)
    assert several.name == "cell_3_1_10.csv and 2 more"
    np.testing.assert_array_equal(several.trajectory.time, record.trajectory.time)


def test_a_clock_that_restarts_in_a_file(tmp_path):
    path = tmp_path / "a.csv"
    two = cycle(cycles=2)
    time = two.time % 9000.0
    write(path, Samples("a", time, two.voltage, two.current, extra=two.extra))
    assert read_record(path).trajectory.cycles == (1, 2)
    write(path, Samples("a", time, two.voltage, two.current, extra=two.extra), "test,time_s,current_A,voltage_V")
    with pytest.raises(BsaError, match="the clock restarts in row 302") as raised:
        read_record(path)
    assert "--join" in raised.value.hint
    assert read_record(path, ReadOptions(join=True)).trajectory.cycles == (1, 2)


def notes(samples: Samples) -> str:
    return "\n".join(to_record(samples, ReadOptions()).notes)


def test_a_sound_record_says_nothing_about_its_charge():
    t = cycle().time
    net = np.concatenate([[0.0], np.cumsum((cycle().current[1:] + cycle().current[:-1]) * 15.0 / 3600)])
    assert "charge" not in notes(cycle(net_ah=net))
    assert "drift" not in notes(cycle(cycles=6))
    assert len(t) == len(net)


def test_charge_in_a_gap_and_between_samples_is_said():
    whole = cycle()
    net = 5.0 + np.cumsum(whole.current) * 30.0 / 3600
    keep = (whole.time < 5000) | (whole.time > 7000)
    said = notes(cycle(net_ah=net).kept(keep & ~((whole.time > 8090) & (whole.time < 8900))))
    assert "1 gap without samples" in said
    assert "the current switches between samples far apart (places: 3; the widest, 840 s, after row 270)" in said
    silent = np.where((whole.time >= 4500) & (whole.time < 7000), 0.0, whole.current)
    gap = Samples("a", whole.time, whole.voltage, silent, extra={"net_ah": net})
    assert "charge passed in 1 gap, by the file's own counter: +0." in notes(gap.kept(keep))


def test_a_drift_of_the_net_charge_is_said():
    assert "the net charge drifts by +0.0" in notes(cycle(cycles=6, leak=0.02))
    assert "more is drawn than charged" in notes(cycle(cycles=6, leak=0.02))


def test_the_steps_of_a_file_cut_where_the_signals_do_not():
    t = np.arange(0.0, 4000.0, 10.0)
    i = np.where(t < 100, 0.0, -1.0)
    plain = Samples("a", t, 4.1 - 1e-4 * t, i)
    kinds = [StepKind.REST, StepKind.CC_DISCHARGE]
    assert [step.kind for step in to_record(plain, ReadOptions()).trajectory.steps] == kinds
    marked = Samples("a", t, 4.1 - 1e-4 * t, i, extra={"step": np.where(t < 100, 1.0, np.where(t < 2000, 2.0, 3.0))})
    steps = to_record(marked, ReadOptions()).trajectory.steps
    assert [step.kind for step in steps] == [*kinds, StepKind.CC_DISCHARGE]
    assert steps[2].start == 200


def step_clock(sampled_s: float = 10.0) -> tuple[Samples, np.ndarray]:
    """A clock that restarts with each step, of a pulse test: rests of 600 s, pulses of 10 s; and the true time."""
    clock, true, current = [], [0.0], []
    for amperes, seconds, interval in [(0.0, 600.0, sampled_s), *[(-5.0, 10.0, 1.0), (0.0, 600.0, sampled_s)] * 3]:
        inside = np.arange(0.0, seconds + interval / 2, interval)
        clock.append(inside)
        true.extend(true[-1] + 1.0 + inside)
        current.append(np.full(len(inside), amperes))
    time, i, at = np.concatenate(clock), np.concatenate(current), np.array(true[1:])
    voltage = 3.9 - 1e-5 * at + 0.02 * i
    return Samples("a", time, voltage, i, extra={"date": MARCH + np.floor(at), "cycle": np.ones(len(time))}), at


def test_a_clock_that_restarts_every_few_rows_is_in_order() -> None:
    time, current = np.tile(np.arange(0.0, 80.0, 10.0), 40), np.repeat(np.tile([0.0, -2.0], 20), 8)
    voltage = 3.9 + 0.02 * current - 1e-3 * np.arange(320)
    record = to_record(Samples("a", time, voltage, current), ReadOptions(join=True))
    assert record.trajectory.duration == pytest.approx(40 * 70.0 + 39 * 10.0)


@pytest.mark.parametrize("sampled_s", [5.0, 10.0])
def test_a_clock_that_restarts_with_short_steps_is_carried_on_by_its_dates(sampled_s):
    samples, at = step_clock(sampled_s)
    record = to_record(samples, ReadOptions())
    np.testing.assert_allclose(record.trajectory.time, at - at[0])
    kinds = [StepKind.REST, *[StepKind.PULSE, StepKind.REST] * 3]
    assert [step.kind for step in record.trajectory.steps] == kinds
    assert record.trajectory.cycles == (1,)
    assert any("carried on 1 s later by its date" in note for note in record.notes)
    assert any("1 more restart of the clock was carried on in the same way" in note for note in record.notes)


def test_a_row_out_of_order_is_no_restart_though_its_date_goes_forward():
    at = np.arange(3600.0)
    time = at.copy()
    time[[50, 150]] -= 20.0
    samples = Samples("a", time, 4.1 - 1e-4 * at, np.full(len(at), -1.0), extra={"date": MARCH + at})
    record = to_record(samples, ReadOptions())
    assert record.trajectory.duration == at[-1]
    assert any("2 samples out of time order were left out" in note for note in record.notes)


@pytest.mark.parametrize("dated", [True, False])
def test_a_clock_of_each_step_makes_no_cycles_of_its_steps(dated):
    """Steps of more than a minute each, so that the clock falls far wherever one begins."""
    whole = cycle("a", MARCH if dated else None, cycles=2)
    step = np.cumsum(np.diff(whole.current, prepend=whole.current[0]) != 0) % 4 + 1.0
    begins = np.flatnonzero(np.diff(step, prepend=0.0) != 0)
    clock = whole.time - whole.time[begins[np.searchsorted(begins, np.arange(len(step)), side="right") - 1]]
    for extra in ({**whole.extra, "step": step}, whole.extra) if dated else ({**whole.extra, "step": step},):
        found = joined([replace(whole, time=clock, extra=extra)], "cell")
        found = carried_on(found, everything=True)
        assert np.all(np.diff(found.time) > 0)
        np.testing.assert_array_equal(found.extra["cycle"], whole.extra["cycle"])


def test_a_test_that_follows_another_in_a_file_counts_its_cycles_on():
    one = cycle("a")
    step = np.cumsum(np.diff(one.current, prepend=one.current[0]) != 0) + 1.0
    twice = Samples(
        *("a", np.tile(one.time, 2), np.tile(one.voltage, 2), np.tile(one.current, 2)),
        extra={"cycle": np.ones(2 * len(one)), "step": np.tile(step, 2)},
    )
    assert set(carried_on(twice, everything=True).extra["cycle"]) == {1.0, 2.0}


def test_a_temperature_that_one_of_the_files_lacks_is_told():
    warm = replace(cycle("a"), temperature=np.full(300, 298.15))
    whole = to_record(joined([cycle("b"), warm], "cell"), ReadOptions())
    assert whole.trajectory.temperature is None
    assert any("has no number in 300 of 600 rows; it is not used" in note for note in whole.notes)


def test_a_clock_that_goes_on_from_part_to_part_is_finer_than_dates_to_the_minute():
    first = cycle("a", MARCH)
    second = replace(cycle("b", MARCH + 9000.0), time=first.time + 9000.0)
    parts = [
        replace(part, extra={**part.extra, "date": np.floor(part.extra["date"] / 60.0) * 60.0})
        for part in (first, second)
    ]
    np.testing.assert_allclose(np.diff(joined(parts, "cell").time), 30.0)


def test_parts_that_alternate_may_begin_with_a_row_without_a_date():
    whole = cycle("a", MARCH)
    odd = np.arange(300) // 50 % 2 == 1
    whole.extra["date"][0] = np.nan
    found = joined([whole.kept(~odd), whole.kept(odd)], "cell")
    np.testing.assert_allclose(found.time, whole.time)
