"""What a run may spend on its language model."""

from pathlib import Path

from bsa.core.run.allowance import Allowance, allowance_of, kept_allowance
from bsa.core.run.journal import Journal, read_events


def test_the_limit_that_is_reached_is_told_and_twice_it_offered() -> None:
    limits = Allowance(1000, 0.5)
    assert limits.spent(999, 0.4999) == ""
    assert limits.larger(999, 0.4999) == {}
    assert limits.spent(1200, 0.1) == "1200 tokens used of --max-tokens 1000"
    assert limits.larger(1200, 0.1) == {"max_tokens": 2400}
    assert limits.spent(10, 0.5) == "$0.5000 spent of --max-cost 0.5"
    assert limits.larger(10, 0.5) == {"max_cost": 1.0}
    assert Allowance().spent(10**9, 1e6) == ""
    # Twice nothing is nothing.
    assert Allowance(0, 0.0).larger(0, 0.0) == {"max_tokens": 1, "max_cost": 1.0}


def test_what_is_left_out_is_as_it_was(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "run")
    journal.append("run")
    for given, kept in (
        (Allowance(), Allowance()),
        (Allowance(1000), Allowance(1000)),
        (Allowance(None, 0.5), Allowance(1000, 0.5)),
        (Allowance(), Allowance(1000, 0.5)),
        (Allowance(2000), Allowance(2000, 0.5)),
    ):
        assert kept_allowance(journal, list(read_events(tmp_path / "run")), given) == kept
    journal.close()
    events = list(read_events(tmp_path / "run"))
    assert allowance_of(events) == Allowance(2000, 0.5)
    # It is written down where it changes.
    assert [event["event"] for event in events] == ["run", *["allowance"] * 3]
