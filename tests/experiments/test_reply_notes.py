"""What is said of a run in which no reply of the language model could be used."""

from collections.abc import Callable
from pathlib import Path

from bsa.backends.rules.backend import RulesBackend
from bsa.core.messages import Reply
from bsa.core.run.loop import RunResult
from bsa.core.run.run_config import RunConfig
from bsa.experiments.cli.run import _how_to_go_on
from bsa.experiments.reply_notes import only_lost_rounds, reply_notes
from bsa.experiments.run_record import read_run
from bsa_toy_cell import toy_scaffold


class Chatty(RulesBackend):
    def complete(self, *given: object, **seed: object) -> Reply:
        return Reply("I am afraid I cannot do that.")


def test_a_run_of_useless_replies_advises_another_model_and_not_more_rounds(
    run_toy: Callable[..., RunResult], tmp_path: Path
) -> None:
    scaffold = toy_scaffold(warm_up=None)
    result = run_toy(tmp_path, scaffold=scaffold, backend=Chatty(), rounds=2)
    (said,) = reply_notes(result)
    assert said.startswith("The language model replied 6 times, and no reply could be used. Another model (--backend)")
    assert said in read_run(tmp_path).notes
    config = RunConfig(scaffold=scaffold, rounds=2)
    assert list(_how_to_go_on(result, config, tmp_path, True)) == []


def test_a_fit_that_went_on_without_the_model_is_no_lost_search(
    run_toy: Callable[..., RunResult], tmp_path: Path
) -> None:
    result = run_toy(tmp_path, scaffold=toy_scaffold("hybrid"), backend=Chatty(), simulations=12)
    assert reply_notes(result)
    assert not only_lost_rounds(result)
    assert not reply_notes(run_toy(tmp_path / "rules", rounds=2))
