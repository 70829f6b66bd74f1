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


def test_a_scaffold_that_offers_no_effect_is_written_as_before() -> None:
    # Journals and identities of runs made before there were offers stay valid.
    assert "offers" not in load_scaffold("hybrid").model_dump()
    assert load_scaffold("staged").model_dump()["offers"]
    assert Scaffold.model_validate(load_scaffold("staged").model_dump()) == load_scaffold("staged")
