"""The number of simulations is told where nothing else is said for long."""

from bsa.experiments.told_simulations import ToldSimulations


def test_a_count_is_told_only_after_a_silence() -> None:
    said: list[str] = []
    now = [0.0]
    told = ToldSimulations(said.append, lambda: now[0])
    for now[0], count in ((5.0, 3), (14.0, 4), (16.0, 5), (20.0, 1), (30.0, 1), (32.0, 2)):
        told.simulated(count)
    assert said == ["  12 simulations so far", "  16 simulations so far"]
    now[0] = 40.0
    told("base model: 1 mV")
    now[0] = 50.0
    told.simulated(1)
    assert said[2:] == ["base model: 1 mV"]
