"""A scaffold on the simulator that a task names."""

from bsa.core.scaffold import PluginChoice, Scaffold, load_scaffold


def test_a_scaffold_that_names_no_simulator_takes_the_tasks() -> None:
    full = load_scaffold("full")
    assert full.made_for("oscillator").simulator == PluginChoice(use="oscillator")
    assert full.made_for("") is full
    assert full.simulator == PluginChoice(use="pybamm")


def test_a_scaffold_that_names_one_keeps_it() -> None:
    own = Scaffold.model_validate({"name": "own", "simulator": "toy-cell", "proposer": "agent"})
    assert own.made_for("oscillator") is own
