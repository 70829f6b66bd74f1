import pytest
from bsa.backends import loaded_model
from bsa.experiments.campaign.cell import memory_mb


@pytest.mark.skipif(memory_mb() == 0, reason="this system does not tell the memory of a process")
def test_a_worker_is_not_replaced_for_the_model_that_it_keeps(monkeypatch):
    alone = memory_mb()
    monkeypatch.setattr(loaded_model, "taken_mb", lambda: alone / 2)
    assert memory_mb() < 0.8 * alone
    monkeypatch.setattr(loaded_model, "taken_mb", lambda: 2 * alone)
    assert memory_mb() == 0.0
