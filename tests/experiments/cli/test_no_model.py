"""That no language model answers is said where one is asked, and there alone."""

from bsa.backends.rules.backend import RulesBackend
from bsa.core.run.run_config import RunConfig
from bsa.experiments.cli.no_model import NO_MODEL, NoModelTold
from bsa.experiments.run import execute_run
from bsa_toy_cell import toy_scaffold, toy_task


def test_only_a_scaffold_that_asks_is_told(tmp_path) -> None:
    def told(scaffold: str) -> list[str]:
        said: list[str] = []
        config = RunConfig(scaffold=toy_scaffold(scaffold), rounds=2, warm_up=0, simulations=4)
        execute_run(toy_task(), config, tmp_path / scaffold, NoModelTold(RulesBackend(), said.append), report=False)
        return said

    assert told("full") == [NO_MODEL]
    assert told("least-squares") == []
