"""What the demonstration's record fixes: the hidden cell must lie inside the intervals."""

from pathlib import Path

import pytest
from bsa.backends.rules.backend import RulesBackend
from bsa.core.run.run_config import RunConfig
from bsa.core.scaffold import load_scaffold
from bsa.experiments.run import execute_run
from bsa.experiments.tasks.demo_record import HIDDEN
from bsa.experiments.tasks.find import find_task


@pytest.mark.slow
def test_the_hidden_cell_lies_inside_the_intervals(tmp_path: Path) -> None:
    task = find_task("demo")
    # How many draws settle the intervals differs from processor to processor, as do the last digits of the fit. The
    # search ends by itself; the analysis has room for all rounds of draws and for what to measure next.
    config = RunConfig(scaffold=load_scaffold("least-squares"), simulations=200, rounds=60, warm_up=0)
    analysis = execute_run(task, config, tmp_path, RulesBackend(), analysing=True).analysis
    assert analysis is not None
    intervals = analysis.identifiability.intervals
    for name, value in {**task.space.initial, **HIDDEN}.items():
        assert intervals[name].lower <= value <= intervals[name].upper, name
    # A charge and a discharge at 1C hardly show the separator, and pulses or a faster discharge do.
    assert analysis.worst == "Separator thickness [m]"
    assert intervals["Negative electrode thickness [m]"].verdict == "fixed"
    assert len(analysis.measure_next) == 5
    first, *_, last = analysis.measure_next
    assert first.name in ("discharge at 2C", "pulses of 1C with rests")
    assert last.name == "slow discharge at C/20"
    assert first.worst_share_of_range < 0.7 * intervals[analysis.worst].share_of_range
    report = (tmp_path / "report.html").read_text()
    assert "What the record fixes" in report
    assert first.name in report
