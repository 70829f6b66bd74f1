"""A cell is keyed by what determines its result, and by nothing else."""

import importlib
from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.campaign import identity
from bsa.experiments.campaign.study_cell import plan_study

PACKAGE = Path(identity.__file__).parents[2]


def identities(plan):
    return [cell.identity for cell in plan.cells]


def test_the_product_in_order_of_tasks(make_plan):
    plan = make_plan(seeds=[1, 2])
    assert [(cell.task.key, cell.config.scaffold.name, cell.config.seed) for cell in plan.cells] == [
        (task, scaffold, seed) for task in ("toy-0", "toy-1") for scaffold in ("full", "no-memory") for seed in (1, 2)
    ]
    assert len(set(identities(plan))) == 8


@pytest.mark.parametrize(
    "change",
    [
        {"rounds": 3},
        {"simulations": 6},
        {"warm_up": 1},
        {"seeds": [9]},
        {"settings.patience": 4},
        {"settings.feedback.use": "scalar"},
        {"backends": [{"use": "rules", "options": {"votes": 3}}]},
    ],
    ids=str,
)
def test_a_changed_key_is_another_cell(make_plan, change):
    assert not set(identities(make_plan())) & set(identities(make_plan(changes=change)))


def test_another_task_of_the_same_name_is_another_cell(make_plan, tmp_path):
    before = make_plan(tasks=1)
    target = tmp_path / "grid" / "toy-0.json"
    plan = make_plan(tasks=2)
    (tmp_path / "grid" / "toy-1.json").rename(target)
    text = target.read_text().replace('"toy-1"', '"toy-0"')
    target.write_text(text)
    from bsa.experiments.campaign.running import plan_grid

    after = plan_grid(str(tmp_path / "grid" / "toys.yaml"), tmp_path / "store", {"tasks": ["toy-0.json"]})
    assert set(identities(plan)) >= set(identities(before))
    assert not set(identities(before)) & set(identities(after))


def test_where_it_runs_does_not_enter(make_plan):
    """A server that moved, or a store elsewhere, is the same cell."""
    here = {"use": "openai:m", "options": {"base_url": "http://127.0.0.1:1/v1", "temperature": 0.5}}
    there = {
        "use": "openai:m",
        "options": {"base_url": "http://127.0.0.2:2/v1", "timeout_s": 9, "temperature": 0.5},
        "at_once": 4,
    }
    one = make_plan(backends=[here])
    two = make_plan(backends=[there], store="elsewhere")
    assert identities(one) == identities(two)
    assert two.cells[0].backend.options["base_url"].startswith("http://127.0.0.2")
    warmer = make_plan(backends=[{**here, "options": {**here["options"], "temperature": 0.6}}])
    assert not set(identities(one)) & set(identities(warmer))


def test_other_code_is_another_cell(make_plan, monkeypatch):
    before = identities(make_plan())
    identity.versions_of.cache_clear()
    monkeypatch.setattr(identity, "code_digest", lambda: "another")
    assert not set(before) & set(identities(make_plan()))
    monkeypatch.undo()
    identity.versions_of.cache_clear()
    assert identities(make_plan()) == before


def test_other_code_of_studies_is_another_item_and_no_other_calibration(make_plan, monkeypatch, tmp_path):
    def items():
        return identities(plan_study("s", print, {"a": {"seed": 1}}, tmp_path / "studies"))

    study, calibrations = items(), identities(make_plan())
    monkeypatch.setattr(identity, "study_digest", lambda: "another")
    assert items() != study
    assert identities(make_plan()) == calibrations


def test_what_makes_tasks_and_carries_out_studies_and_discoveries_counts(monkeypatch):
    asked = []
    monkeypatch.setattr(identity, "package_digest", lambda *patterns: asked.extend(patterns))
    identity.study_digest()
    counted = {place for pattern in asked for place in PACKAGE.glob(pattern)}
    experiments = PACKAGE / "experiments"
    assert {experiments / name for name in ("tasks", "suite", "studies", "discovery_bench")} <= counted
    assert {experiments / name for name in ("discover.py", "discover_life.py", "discovery_setup.py")} <= counted
    assert not {experiments / name for name in ("cli", "report")} & counted


def test_plugins_of_others_count_by_their_version(make_plan):
    plan = make_plan()
    found = dict(identity.versions_of((("simulator", "toy-cell"), ("backend", "rules"))))
    assert found["simulator toy-cell"].startswith("bsa-toy-cell ")
    assert "backend rules" not in found
    assert plan.cells


def test_include_and_exclude(make_plan):
    plan = make_plan(
        tasks=3,
        include=[{"scaffolds": ["random"], "tasks": ["toy-0.json"], "simulations": 4}, {"seeds": [1]}],
        exclude=[{"task": ["toy-1", "toy-2"], "scaffold": "no-*"}],
    )
    found = [(cell.task.key, cell.config.scaffold.name, cell.config.simulations) for cell in plan.cells]
    assert found == [
        ("toy-0", "full", 5),
        ("toy-0", "no-memory", 5),
        ("toy-1", "full", 5),
        ("toy-2", "full", 5),
        ("toy-0", "random", 4),
    ]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"scaffolds": ["ful"]}, "full"),
        ({"backends": ["rulez"]}, "rules"),
        ({"backends": [{"use": "openai:m", "options": {"base_url": "localhost"}}]}, "an address starts with http"),
        ({"settings": {"simulator.use": "toy-sell"}}, "toy-cell"),
        ({"settings": {"patienc": 1}}, "patienc"),
        ({"exclude": [{"colour": "red"}]}, "colour"),
        ({"exclude": [{"task": "*"}]}, "no cells"),
    ],
)
def test_what_does_not_exist_is_said_before_anything_runs(make_plan, content, words):
    with pytest.raises(BsaError, match=words):
        make_plan(**content)


PLUGIN = """
from bsa.core.hooks import Entry, hookimpl

class Stand:
    def __init__(self, options, context):
        pass
    @hookimpl
    def propose(self, context):
        return None

@hookimpl
def bsa_proposers():
    yield Entry("zz-stand", Stand, "Stays.", api=1)
"""


@pytest.fixture
def fresh():
    """Forgets what was read of installed plugins, as a new process would have to read it."""

    def forget():
        importlib.invalidate_caches()
        for cached in (identity.versions_of, identity.plugin_digest):
            cached.cache_clear()

    forget()
    yield forget
    forget()


def test_edited_code_of_a_plugin_is_another_cell_though_its_version_stays(stranger, fresh):
    folder = stranger(PLUGIN)
    asked = (("proposer", "zz-stand"),)
    before = identity.versions_of(asked)
    assert dict(before)["proposer zz-stand"].startswith("zz-fault 0.1 ")
    fresh()
    assert identity.versions_of(asked) == before
    (module,) = folder.glob("zz_module_*.py")
    module.write_text(module.read_text() + "# edited\n")
    fresh()
    assert identity.versions_of(asked) != before


def test_every_source_of_a_package_counts_wherever_it_lies(tmp_path, monkeypatch, fresh):
    def digest_in(place, table):
        about, package = tmp_path / place / "zz_pack-1.dist-info", tmp_path / place / "zz_pack"
        for folder in (about, package / "deep"):
            folder.mkdir(parents=True)
        (about / "METADATA").write_text("Metadata-Version: 2.1\nName: zz-pack\nVersion: 1\n")
        (about / "entry_points.txt").write_text("[bsa]\nzz-pack = zz_pack.deep:hooks\n")
        (package / "__init__.py").write_text("")
        (package / "deep" / "table.json").write_text(table)
        (package / "picture.png").write_text(place)
        monkeypatch.syspath_prepend(str(tmp_path / place))
        fresh()
        return identity.plugin_digest("zz-pack")

    first = digest_in("here", "[1]")
    assert first
    assert digest_in("there", "[1]") == first
    assert digest_in("elsewhere", "[2]") != first


def test_effects_count_in_the_tasks_and_discoveries_that_have_them(make_plan, monkeypatch):
    config = make_plan().cells[0].config
    asked = []
    monkeypatch.setattr(identity, "versions_of", lambda plugins: asked.append(plugins) or ())
    identity.identity_of(config, "digest", ("zz-growth (slow)",))
    assert ("effect", "zz-growth.slow") in asked[0]
    offering = config.model_copy(update={"scaffold": config.scaffold.model_copy(update={"offers": ["zz-growth.fast"]})})
    identity.identity_of(offering, "digest")
    assert ("effect", "zz-growth.fast") in asked[1]
    assert ("effect", "kinetics-marcus") in identity.all_effects()
