"""A run that is part of longer work."""

from pathlib import Path

from bsa.backends.rules.backend import RulesBackend
from bsa.core.run.run_config import RunConfig
from bsa.experiments.run import execute_run
from bsa.experiments.told_run import ToldRun
from bsa_toy_cell import toy_scaffold, toy_task


def test_a_line_every_ten_simulations_tells_the_best_error(tmp_path: Path) -> None:
    said: list[str] = []
    config = RunConfig(scaffold=toy_scaffold("random"), rounds=30, warm_up=0, simulations=25)
    told = ToldRun(toy_task(), 25, said.append)
    execute_run(toy_task(), config, tmp_path, RulesBackend(), listener=told, report=False)
    assert [line.split(":")[0] for line in said] == [f"  {made} of 25 simulations at most" for made in (10, 20)]
    assert all(line.endswith("% total MAPE") for line in said)
