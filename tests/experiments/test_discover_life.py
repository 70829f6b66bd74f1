"""`bsa discover --life`: what it refuses, and lives whose mechanism is known."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from bsa.core.ageing.changes import Changes
from bsa.core.errors import BsaError
from bsa.experiments.cli.main import main
from bsa.experiments.discover_life import LifeSimulator, discover_life
from bsa.experiments.request import CellChoice, Records, reading, task_of_records
from bsa.experiments.studies.life_discovery import HIDDEN, make
from bsa.plugins.effects.ageing import EFFECTS

COLUMNS = {"time": "time_s", "current": "current_A", "voltage": "voltage_V"}
READ = reading(COLUMNS, temperature=25.0)


@pytest.fixture(scope="module")
def short_life(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("life") / "life.csv"
    make(HIDDEN["diffusion"], path, 0, 6)
    return path


def test_two_lives_are_two_discoveries(short_life: Path, tmp_path: Path) -> None:
    with pytest.raises(BsaError, match="2 lives"):
        discover_life(Records([short_life, short_life], read=READ), CellChoice("Chen2020", "SPM"), tmp_path / "out")


def test_every_effect_of_ageing_is_absent_at_its_null(short_life: Path) -> None:
    """Each is compiled beside a cell that does not age, and shows the same life."""
    ageless = CellChoice("Chen2020", "SPM", {"SEI": "none"}, search="cell")
    task = task_of_records(Records([short_life], read=READ, life=True), ageless)
    assert "SEI" not in {name for name, kind in task.cell.options.items() if kind != "none"}
    simulator, changes = LifeSimulator(task, task.space.initial), Changes(task, 6)
    (base,) = simulator((), [{}])
    assert base is not None
    ageing = [effect for effect in EFFECTS if effect.ages and effect.name != "porosity-change"]
    assert len(ageing) == 8
    for effect in ageing:
        (found,) = simulator((effect,), [{effect.full_name(effect.strength): 0.0}])
        assert found is not None, effect.key
        # A film as thick as that of the set is there in every cycle.
        assert np.sqrt(np.mean((changes(found) - changes(base)) ** 2)) < 0.1, effect.key


@pytest.mark.slow
@pytest.mark.parametrize("case", ["diffusion", "resistance"])
def test_the_hidden_mechanism_is_named(case: str, tmp_path: Path) -> None:
    make(HIDDEN[case], tmp_path / "life.csv", 0, 100)
    records = Records([tmp_path / "life.csv"], read=READ, fit_cycles=60)
    found = discover_life(records, CellChoice("Chen2020", "SPM"), tmp_path / "out")
    assert (found.findings.verdict, found.names) == ("effect-found", (HIDDEN[case].name,))
    content = json.loads((tmp_path / "out" / "discovery.json").read_text())
    assert content["effects"] == [HIDDEN[case].name]
    assert content["candidates"][0]["later_error"] < 0.3 * content["base"]["later_error"]


def test_what_a_life_is_not_asked_with_is_refused(
    short_life: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["bsa", "discover", "--data", str(short_life), "--life", "--parameters", "Chen2020"]
    monkeypatch.setattr(sys, "argv", [*arguments, "--search", "capacity", "--override", "x=1"])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert "--override and --search cannot be given with --life" in capsys.readouterr().err
