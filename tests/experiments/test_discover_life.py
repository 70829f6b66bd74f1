"""`bsa discover --life`: its folder, its options, and lives whose mechanism is known."""

import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import bsa
import numpy as np
import pytest
from bsa.core.ageing.changes import Changes
from bsa.core.comparison.residuals import residuals
from bsa.core.contracts.requests import LifeRequest, LifeResiduals
from bsa.core.effect import Effect, EffectParameter
from bsa.core.errors import BsaError
from bsa.core.run.journal import read_events
from bsa.core.simulation import ExperimentRun, Outcome
from bsa.experiments import discover_life
from bsa.experiments.api.scripts import namespace_of
from bsa.experiments.cli.main import main
from bsa.experiments.discover import discover
from bsa.experiments.discovery_case import DiscoverOptions, discover_options
from bsa.experiments.read_options import reading
from bsa.experiments.studies import life_discovery
from bsa.experiments.studies.life_discovery import HIDDEN, make
from bsa.experiments.task_request import CellChoice, Records, task_of_records
from bsa.plugins.effects.ageing import EFFECTS
from bsa.plugins.pybamm.export.calibrated_script import script
from bsa.plugins.pybamm.simulators.life_simulator import LifeSimulator
from bsa.plugins.pybamm.solving.long_experiment import LongExperiment
from bsa_toy_life import life, life_task

COLUMNS = {"time": "time_s", "current": "current_A", "voltage": "voltage_V"}
READ = reading(COLUMNS, temperature=25.0)
CYCLES = 200
BENDS = {"root": 0.5, "linear": 1.0, "late": 3.0}
MECHANISMS = [
    Effect(name, name, "", (EffectParameter("lost", "A.h", 0.0, 0.0, 0.8, 1e-3),), "", "", ages=True) for name in BENDS
]


class ToyLives:
    """Lives on paper in place of simulated ones; stops after so many, as Ctrl-C would."""

    at_once, has_low_fidelity = 1, False
    most, asked = 10**9, 0

    def __init__(self, task: object, workers: int) -> None:
        self.refused: dict[str, str] = {}

    def predict(self, requests: Sequence[LifeRequest]) -> list[LifeResiduals | None]:
        return [self._one(request) for request in requests]

    def _one(self, request: LifeRequest) -> LifeResiduals | None:
        type(self).asked += 1
        if self.asked > self.most:
            raise KeyboardInterrupt
        lives = [
            life(CYCLES, effect.values(request.candidate)["lost"], BENDS[effect.name]) for effect in request.effects
        ]
        found = residuals(life_task(life(CYCLES, 0.1)), Outcome((ExperimentRun((lives or [life(CYCLES, 0.0)])[0]),)))
        return None if found is None else LifeResiduals(found)

    def close(self) -> None:
        pass


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A record that stands for a life on paper; nothing is simulated."""
    monkeypatch.setattr(
        discover_life, "read_life", lambda options: replace(life_task(life(CYCLES, 0.1)), notes=("assumed",))
    )
    monkeypatch.setattr(discover_life, "_first_cycle", lambda *arguments: {})
    monkeypatch.setattr(discover_life, "degradation_modes", lambda *arguments: [])
    monkeypatch.setattr(discover_life, "effects_of", lambda *arguments: MECHANISMS)
    monkeypatch.setattr(discover_life, "LifeSimulatorPool", ToyLives)
    monkeypatch.setattr(discover_life, "script", lambda *arguments: "")
    monkeypatch.setattr(ToyLives, "most", 10**9)
    monkeypatch.setattr(ToyLives, "asked", 0)
    (tmp_path / "life.csv").write_text("a record")
    return tmp_path / "life.csv"


def options(record: Path, out: Path) -> DiscoverOptions:
    return discover_options(Records([record], life=True), out, parameters="Chen2020")


def kept(folder: Path) -> int:
    return sum(event["event"] == "simulation" for event in read_events(folder))


@pytest.mark.slow
def test_a_discovery_that_was_stopped_keeps_every_simulation(
    toy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = discover(options(toy, tmp_path / "whole"))
    assert (whole.verdict, whole.names) == ("effect-found", ("linear",))
    asked = ToyLives.asked
    for number, most in enumerate((1, asked // 3, asked // 2), start=1):
        monkeypatch.setattr(ToyLives, "asked", 0)
        monkeypatch.setattr(ToyLives, "most", most)
        with pytest.raises(KeyboardInterrupt):
            discover(options(toy, tmp_path / "stopped"))
        assert ToyLives.asked == most + 1, number
    before = kept(tmp_path / "stopped")
    assert before == 1 + asked // 3 + asked // 2
    monkeypatch.setattr(ToyLives, "asked", 0)
    monkeypatch.setattr(ToyLives, "most", 10**9)
    found = discover(options(toy, tmp_path / "stopped"))
    assert ToyLives.asked == asked - before
    spent = [event.get("wall_s", 0.0) for event in read_events(tmp_path / "stopped") if event["event"] == "end"]
    assert len(spent) == 4, "each time that it was stopped, and at the end"
    assert found.wall_s == pytest.approx(sum(spent)), "what is reported is what the journal keeps"
    same = [{**one.to_json(), "wall_s": 0.0} for one in (whole, found)]
    assert same[0] == same[1]
    content = json.loads((tmp_path / "stopped" / "discovery.json").read_text())
    assert content["effects"][0]["name"] == "linear"
    assert "A h" in (tmp_path / "stopped" / "report.html").read_text()


@pytest.mark.parametrize("fit_cycles", [1, CYCLES])
def test_a_life_of_which_nothing_is_held_out_or_changes_is_refused(toy: Path, tmp_path: Path, fit_cycles: int) -> None:
    with pytest.raises(BsaError, match="cycles are to be fitted") as caught:
        discover(options(toy, tmp_path / "found").model_copy(update={"fit_cycles": fit_cycles}))
    assert f"to {CYCLES - 1}" in caught.value.hint
    assert not (tmp_path / "found").exists()


def test_a_cell_that_does_not_run_through_its_life_is_an_error_before_its_modes_are_sought(
    toy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ToyLives, "_one", lambda self, request: None)
    monkeypatch.setattr(discover_life, "degradation_modes", lambda *_: pytest.fail("modes were sought"))
    with pytest.raises(BsaError, match="does not run through its life"):
        discover(options(toy, tmp_path / "found"))


def test_ctrl_c_says_how_it_goes_on_and_the_rest_is_printed_as_json(
    toy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "found"
    task = replace(life_task(life(CYCLES, 0.1)), notes=("starts full",))
    monkeypatch.setattr(discover_life, "read_life", lambda options: task)
    monkeypatch.setattr(ToyLives, "most", 12)
    start = ["bsa", "discover", "--data", str(toy), "--fit-cycles", "120", "--parameters", "Chen2020"]
    monkeypatch.setattr(sys, "argv", [*start, "--out", str(folder)])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 130
    assert f"Stopped: interrupted. Go on with: bsa discover --resume {folder}" in capsys.readouterr().err
    monkeypatch.setattr(ToyLives, "most", 10**9)
    monkeypatch.setattr(sys, "argv", ["bsa", "discover", "--resume", str(folder), "--json"])
    with pytest.raises(SystemExit):
        main()
    said = capsys.readouterr()
    content = json.loads(said.out)
    assert (content["verdict"], content["fit_cycles"]) == ("effect-found", 120)
    assert all(f"{name}: " in said.err for name in BENDS)
    assert "\nnote: starts full\n" in said.err
    monkeypatch.setattr(sys, "argv", ["bsa", "discover", "--resume", str(folder)])
    with pytest.raises(SystemExit):
        main()
    said = capsys.readouterr()
    assert f"verdict: effect-found\n  {content['headline']}\n  linear: " in said.out
    assert "95 % interval" in said.out
    assert "Later cycles: " in said.out
    assert content["notes"] == ["starts full"]


def test_the_python_function_shows_what_was_found(toy: Path, tmp_path: Path) -> None:
    found = bsa.discover(toy, life=True, parameters="Chen2020", out=tmp_path / "found", progress=False)
    assert (found.verdict, found.effects) == ("effect-found", ("linear",))
    assert found.to_json() == json.loads((found.folder / "discovery.json").read_text())
    assert found.headline == found.to_json()["headline"]
    assert f"<p>{found.headline}: {found.to_json()['reason']}</p>" in found._repr_html_()
    errors = found.errors["Later cycles [standard deviations]"]
    assert errors["best"] < 0.1 * errors["initial"]
    low, high = found.intervals["linear: lost"]
    assert low <= found.parameters["linear: lost [A.h]"] <= high
    assert found.report.is_file()
    assert "A h" in found._repr_html_()
    assert "linear" in repr(found)
    assert bsa.discover(resume=found.folder, progress=False).parameters == found.parameters


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (["--search", "capacity"], "--search cannot be given with --life"),
        (["--backend", "rules"], "--backend cannot be given with --life"),
        (["--holdout", "other.csv"], "--holdout cannot be given with --life"),
        (["--fit-cycles", "0"], "--fit-cycles"),
    ],
)
def test_what_a_life_is_not_asked_with_is_refused(
    typed: list[str],
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = ["bsa", "discover", "--data", "life.csv", "--life", "--parameters", "Chen2020", *typed]
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert words in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def short_life(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("life") / "life.csv"
    make(HIDDEN["diffusion"], path, 0, 6)
    return path


@pytest.mark.slow
def test_every_effect_of_ageing_is_absent_at_its_null(short_life: Path) -> None:
    """Each is compiled beside a cell that does not age, and shows the same life."""
    ageless = CellChoice("Chen2020", "SPM", {"SEI": "none"}, search="cell")
    task = task_of_records(Records([short_life], reads=[READ], life=True), ageless)
    assert "SEI" not in {name for name, kind in task.cell.options.items() if kind != "none"}
    simulator, changes, cell = LifeSimulator(task), Changes(task, 6), task.space.initial
    (base,) = simulator.predict([LifeRequest((), cell)])
    assert base is not None
    ageing = [effect for effect in EFFECTS if effect.ages and effect.name != "porosity-change"]
    assert len(ageing) == 11
    for effect in ageing:
        (found,) = simulator.predict([LifeRequest((effect,), {**cell, effect.full_name(effect.strength): 0.0})])
        assert found is not None, effect.key
        # A film as thick as that of the set is there in every cycle.
        assert np.sqrt(np.mean((changes(found.residual) - changes(base.residual)) ** 2)) < 0.1, effect.key


@pytest.mark.slow
def test_the_script_of_a_life_ages_as_it_was_fitted(short_life: Path) -> None:
    ageless = CellChoice("Chen2020", "SPM", {"SEI": "none"}, search="cell")
    task = task_of_records(Records([short_life], reads=[READ], life=True), ageless)
    growth = next(effect for effect in EFFECTS if effect.key == "sei-growth (diffusion-limited)")
    candidate = {**task.space.initial, growth.full_name(growth.strength): 1e4}
    (experiment,) = task.experiments
    fitted = LongExperiment(task.cell, experiment, task.space.targets, effects=(growth,), leave_out=False)
    record = fitted.solve(candidate).trajectory
    assert record is not None
    assert record.cycle_table is not None
    cycles = namespace_of(script(task, candidate, (growth,)), "augmented_model")["simulate"]().cycles
    capacities = [np.ptp(cycle.steps[3]["Discharge capacity [A.h]"].entries) for cycle in cycles]
    lost = [1.0 - values[-1] / values[0] for values in (capacities, record.cycle_table.capacity_ah)]
    assert lost[0] > 1e-3
    assert lost[0] == pytest.approx(lost[1], rel=0.05)


def test_an_effect_that_cannot_be_built_costs_only_itself(short_life: Path) -> None:
    ageless = CellChoice("Chen2020", "SPM", {"SEI": "none"}, search="cell")
    task = task_of_records(Records([short_life], reads=[READ], life=True), ageless)
    foreign = replace(EFFECTS[0], name="foreign", physics="for another simulator")
    simulator = LifeSimulator(task)
    assert simulator.predict([LifeRequest((foreign,), task.space.initial)]) == [None]
    assert "not written for PyBaMM" in simulator.refused[foreign.key]


@pytest.mark.slow
@pytest.mark.parametrize("case", ["diffusion", "resistance"])
def test_the_hidden_mechanism_is_named(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In 24 cycles without rests."""
    monkeypatch.setattr(life_discovery, "CYCLE", tuple(step for step in life_discovery.CYCLE if "Rest" not in step))
    make(HIDDEN[case], tmp_path / "life.csv", 0, 24)
    records = Records([tmp_path / "life.csv"], reads=[READ], fit_cycles=15)
    found = discover(discover_options(records, tmp_path / "out", parameters="Chen2020", model="SPM"))
    assert (found.verdict, found.names) == ("effect-found", (HIDDEN[case].name,))
    content = json.loads((tmp_path / "out" / "discovery.json").read_text())
    assert content["effects"][0]["name"] == HIDDEN[case].name
    assert content["gap"]["later_final_error"] < 0.3 * content["gap"]["later_base_error"]
