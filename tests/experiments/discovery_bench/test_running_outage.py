"""A blind case whose language model could not be had leaves no row."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest
from bsa.core.discovery.ranking import Ranking
from bsa.core.messages import Outage
from bsa.experiments.discovery_bench import running, shortlists


@pytest.mark.parametrize("module", [running, shortlists])
def test_an_outage_is_no_row(module, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lost = Ranking((), note="nothing listens", lost=True)
    nomination = SimpleNamespace(lacks=(), gain=1.0, effect=SimpleNamespace(key="heat"))
    known = SimpleNamespace(nominations=[nomination], refitted=None)
    bench = SimpleNamespace(
        engine=lambda settings: SimpleNamespace(shortlist=lambda: known),
        discrepancy=lambda refitted: ["28 mV too high"],
    )
    options = SimpleNamespace(settings=None, seed=1)
    monkeypatch.setattr(module, "options_of", lambda folder, **asked: options)
    monkeypatch.setattr(module, "read_case", lambda options: None)
    monkeypatch.setattr(module, "set_up", lambda case, options: bench)
    monkeypatch.setattr(module, "backend_or_none", lambda options: nullcontext(object()))
    monkeypatch.setattr(running, "discover_on", lambda *_: SimpleNamespace(ranking=lost))
    monkeypatch.setattr(shortlists, "ask", lambda *_: lost)
    work = running.run_case if module is running else shortlists.shortlist_case
    with pytest.raises(Outage, match="nothing listens"):
        work(tmp_path)
