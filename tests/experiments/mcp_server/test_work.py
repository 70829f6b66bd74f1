"""How far a run is, by its journal."""

from pathlib import Path

import pytest

pytest.importorskip("mcp", reason='pip install "battery-sim-agent[mcp]"')

from bsa.core.messages import BudgetSpent
from bsa.experiments.mcp_server.work import _progress, _stopped


def test_an_interrupt_is_told_as_one() -> None:
    assert _stopped(KeyboardInterrupt()) == "stopped: interrupted."
    assert _stopped(BudgetSpent("2000 tokens are used")) == "stopped: 2000 tokens are used."


def test_the_analysis_of_a_fit_is_told_apart_from_its_simulations(tmp_path: Path) -> None:
    assert _progress(tmp_path, 9, 1.0) == (0.0, 9, "starting")
    journal = tmp_path / "journal.jsonl"
    journal.write_text('{"event":"run"}\n{"event":"trial"}\n{"event":"trial"}\n')
    assert _progress(tmp_path, 9, 2.0) == (2, 9, "2 simulations in 2 s")
    journal.write_text(journal.read_text() + '{"event":"appraisal-simulation"}\n')
    assert _progress(tmp_path, 9, 3.0) == (2, 9, "2 simulations, then 1 to analyse the fit, in 3 s")
    assert _progress(tmp_path, None, 3.0)[1:] == (None, "4 steps in 3 s")
    assert _progress(None, None, 3.0) == (3.0, None, "3 s")
