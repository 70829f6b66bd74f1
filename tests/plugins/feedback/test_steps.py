import pytest
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.plugins.feedback import steps
from bsa_toy_cell import HIDDEN, record, toy_task


def test_the_steps_to_be_told_are_chosen_once(monkeypatch: pytest.MonkeyPatch) -> None:
    # A long record has thousands of steps.
    task, chosen, choose = toy_task(), [], steps._longest
    monkeypatch.setattr(steps, "_longest", lambda *about: chosen.append(about) or choose(*about))
    told = steps.by_step(task, Outcome((ExperimentRun(record(HIDDEN)),)))
    assert len(told["steps"]["rows"]) > 1
    assert len(chosen) == 1
