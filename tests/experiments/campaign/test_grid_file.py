"""Grid files: what is refused, and with which words."""

import json

import pytest
from bsa.core.encoding import encode_task
from bsa.core.errors import BsaError
from bsa.core.scaffold import BUILT_IN
from bsa.experiments.campaign.expansion import expand
from bsa.experiments.campaign.grid_file import load_grid, shipped_names
from bsa.experiments.campaign.running import run_campaign
from bsa.experiments.campaign.store import Store
from bsa.experiments.suite.case import SuiteCase
from bsa_toy_cell import HIDDEN, toy_task

from .conftest import Here, Quiet, write_grid


def test_a_wrong_key_is_named_with_the_nearest_one(tmp_path):
    path = write_grid(tmp_path, scafolds=["full"])
    with pytest.raises(BsaError, match=r'"scafolds" is not a known key.*did you mean "scaffolds"'):
        load_grid(str(path))


def test_an_unknown_grid_is_named_with_the_shipped_ones():
    with pytest.raises(BsaError, match="qwen-scaling"):
        load_grid("qwen-scale")


@pytest.mark.parametrize("seeds", [[-1], [], ["x"]])
def test_seeds_are_checked(tmp_path, seeds):
    with pytest.raises(BsaError, match="seeds"):
        load_grid(str(write_grid(tmp_path, seeds=seeds)))


@pytest.mark.parametrize(
    "included", [{"seeds": [-1]}, {"seeds": []}, {"scaffolds": []}, {"backends": []}, {"tasks": []}]
)
def test_axes_of_included_cells_are_checked_as_those_of_the_grid(tmp_path, included):
    (key,) = included
    with pytest.raises(BsaError, match=key):
        load_grid(str(write_grid(tmp_path, include=[included])))


def test_set_replaces_any_key(tmp_path):
    path = write_grid(tmp_path, backends=["rules", {"use": "ollama:x", "at_once": 2}])
    changes = {
        "rounds": 7,
        "seeds": [4, 5],
        "backends.1.at_once": 3,
        "tasks.0": "demo",
        "settings.feedback.use": "scalar",
        "reference": "no-memory",
    }
    grid = load_grid(str(path), changes)
    assert (grid.rounds, grid.seeds, grid.backends[1].at_once, grid.tasks[0]) == (7, [4, 5], 3, "demo")
    assert grid.settings == {"simulator.use": "toy-cell", "feedback.use": "scalar"}
    assert grid.reference == "no-memory"


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("round", "rounds"),
        ("tasks.9", "place in a list"),
        ("rounds.x", "rounds is 2, a single value without parts. Hint: replace it as a whole: --set rounds=VALUE"),
        ("tasks.0.cases", r"tasks\.0 is '[^']+', a single value without parts. Hint: .* --set tasks\.0=VALUE"),
    ],
)
def test_set_refuses_what_is_not_there(tmp_path, key, words):
    with pytest.raises(BsaError, match=words):
        load_grid(str(write_grid(tmp_path)), {key: 1})


@pytest.mark.parametrize("name", shipped_names())
def test_shipped_grids_expand(name, tmp_path, monkeypatch):
    """Each is valid, and its cells have working configurations; no target is simulated."""
    changes = {"Negative electrode thickness [m]": 1e-4}
    sets = ("Chen2020", "ORegan2022")
    cases = [
        SuiteCase(mode, number, parameter_set, 1.0, 2.0, changes)
        for mode in ("regular", "extreme")
        for parameter_set in sets
        for number in range(10 * sets.index(parameter_set), 10 * sets.index(parameter_set) + 10)
    ]
    monkeypatch.setattr("bsa.experiments.suite.selection.generated_cases", lambda: {case.key: case for case in cases})
    lives = [SuiteCase("sei", number, "Chen2020", 1.0, 1.0, changes, cycles=200) for number in range(5)]
    monkeypatch.setattr(
        "bsa.experiments.suite.selection.published_cases", lambda *where: {case.key: case for case in lives}
    )
    grid = load_grid(name)
    cells = expand(grid, Store(tmp_path), tmp_path, make=False)
    runs = {
        "main-table": len(cases) * (2 * 4 + 8),
        "qwen-scaling": 8 * 3 * 3,
        "rules-ablation": 10 * 6,
        "scaffold-ablation": 8 * 9 * 3,
        "ageing": 5 * 3,
        "ageing-baselines": 5 * 5,
        "ageing-ablation": 5 * 7,
        "own-lives": 20,
    }
    assert grid.name == name
    assert len(cells) == runs[name]
    assert not list(tmp_path.rglob("*.json"))


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_names())
def test_shipped_grids_stop_nobody_early(name, tmp_path):
    """Patience never ends a run, and methods of one task may spend alike."""
    grid = load_grid(name)
    cells = expand(grid, Store(tmp_path), tmp_path, make=False)
    allowed = {}
    for cell in cells:
        assert cell.config.patience >= cell.config.rounds
        allowed.setdefault(cell.task.key, set()).add((cell.config.rounds, cell.config.warm_up, cell.config.simulations))
    assert all(len(budgets) == 1 for budgets in allowed.values())


def test_a_grid_without_patience_has_that_of_its_rounds_and_may_set_its_own(make_plan):
    def patience(**content):
        return {cell.config.patience for cell in make_plan(rounds=30, **content).cells}

    assert patience() == {30}
    assert patience(settings={"simulator.use": "toy-cell", "patience": 4}) == {4}


@pytest.mark.parametrize(
    ("key", "own"),
    [
        ("seed", "seeds"),
        ("backend", "backends"),
        ("backend_options", "backends"),
        ("backend_options.votes", "backends"),
        ("scaffold", "scaffolds"),
        ("rounds", "rounds"),
        ("warm_up", "warm_up"),
        ("simulations", "simulations"),
    ],
)
def test_settings_that_have_a_key_of_their_own_are_refused(tmp_path, key, own):
    for content in ({"settings": {key: 3}}, {"include": [{"settings": {key: 3}}]}):
        with pytest.raises(BsaError) as refused:
            load_grid(str(write_grid(tmp_path, **content)))
        assert f'"{key}" is set outside of settings: write ' in refused.value.message
        assert own in refused.value.message.partition("write ")[2]


def test_a_part_of_the_scaffold_may_be_a_setting(tmp_path):
    settings = {"warm_up.options.radius": 0.2, "feedback.use": "scalar"}
    assert load_grid(str(write_grid(tmp_path, settings=settings))).settings == settings


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"exclude": [{"scaffold": "no-memry"}]}, 'no scaffold "no-memry". Hint: did you mean "no-memory"'),
        ({"reference": "fulll"}, 'no scaffold "fulll". Hint: did you mean "full"'),
        ({"changes": {"tasks": [{"suite": "generatd", "cases": 2}]}}, "\"tasks.0.suite\" is 'generatd'"),
        ({"changes": {"tasks.0": {"suite": "generatd"}}}, 'did you mean "generated"'),
        ({"changes": {"tasks.0": {"suite": "generated", "case": 2}}}, 'did you mean "cases"'),
    ],
)
def test_names_that_the_grid_has_not_are_refused_with_the_nearest(make_plan, changes, words):
    with pytest.raises(BsaError) as refused:
        make_plan(**changes)
    assert words in str(refused.value)


def test_an_exclusion_by_name_or_pattern_leaves_cells_out(make_plan):
    exclude = [{"scaffold": "no-memory", "task": "toy-1"}, {"task": "extreme-*"}]
    assert len(make_plan(exclude=exclude, reference="no-memory").cells) == 3


@pytest.mark.slow
def test_samplers_of_a_grid_spend_their_whole_budget(make_plan):
    plan = make_plan(tasks=1, scaffolds=["random", "cma-es", "de"], rounds=2, simulations=30)
    rows, _ = run_campaign(plan, Here(), Quiet())
    assert {row["simulations"] for row in rows} == {30}
    assert {row["status"] for row in rows} == {"simulations-spent"}


def test_two_tasks_of_one_name_are_refused_in_included_cells_too(make_plan, tmp_path):
    """Tables pair the cells of methods by the name of their task."""
    other = tmp_path / "other.json"
    other.write_text(json.dumps(encode_task(toy_task({name: 1.02 * value for name, value in HIDDEN.items()}, "toy-0"))))
    with pytest.raises(BsaError, match='two different tasks of the grid are called "toy-0"'):
        make_plan(tasks=1, include=[{"tasks": [str(other)], "scaffolds": ["digest"]}])
    assert {cell.task.key for cell in make_plan(tasks=2, include=[{"tasks": ["toy-1.json"], "seeds": [2]}]).cells} == {
        "toy-0",
        "toy-1",
    }


@pytest.mark.parametrize(
    "content",
    [
        {"include": [{"scaffolds": ["full"], "simulations": 4}]},
        {"backends": ["rules", {"use": "rules", "options": {"votes": 3}}]},
        {"scaffolds": ["full", "mine.yaml"]},
    ],
    ids=["budgets", "options of a backend", "scaffolds of one name"],
)
def test_cells_that_tables_cannot_tell_apart_are_refused(make_plan, tmp_path, content):
    write_grid(tmp_path / "grid")
    mine = (BUILT_IN / "full.yaml").read_text().replace("[priors, history, sensitivities]", "[history]")
    (tmp_path / "grid" / "mine.yaml").write_text(mine)
    with pytest.raises(BsaError, match='2 cells of the task "toy-0" with the scaffold "full", the backend "rules"'):
        make_plan(tasks=1, **content)
