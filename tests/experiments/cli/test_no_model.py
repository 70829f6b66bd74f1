"""That no language model answers is said where one is asked, and there alone."""

from bsa.backends.reviewing import ReviewingBackend, Verdict
from bsa.backends.rules.backend import RulesBackend
from bsa.core.run.journal import read_events
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


def test_what_a_reviewer_refuses_is_no_lost_call(tmp_path) -> None:
    verdicts = iter([Verdict("refuse", "too bold")])
    reviewed = ReviewingBackend(RulesBackend(), lambda shown: next(verdicts, Verdict("accept")))
    config = RunConfig(scaffold=toy_scaffold("full"), rounds=1, warm_up=0, simulations=2)
    execute_run(toy_task(), config, tmp_path, NoModelTold(reviewed, lambda text: None), report=False)
    kinds = [event["event"] for event in read_events(tmp_path)]
    assert [kind for kind in kinds if kind in ("reply", "review", "lost-call")] == ["reply", "review"] * 2
