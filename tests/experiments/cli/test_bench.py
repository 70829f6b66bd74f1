import inspect

import pytest
from bsa.core.errors import BsaError
from bsa.experiments.cli.bench import bench_app, suite_command
from bsa.experiments.cli.bench_discovery import discovery_app
from bsa.experiments.cli.discover import discover
from bsa.experiments.cli.run import run


def test_every_study_of_a_suite_can_be_told_where_the_published_tasks_are():
    takes = {c.callback.__name__: set(inspect.signature(c.callback).parameters) for c in bench_app.registered_commands}
    of_a_suite = {name for name, options in takes.items() if "suite" in options}
    assert len(of_a_suite) >= 4
    assert {name for name in of_a_suite if "published" not in takes[name]} == set()


def test_every_command_that_takes_a_backend_can_be_told_how_to_reach_it():
    apps = (bench_app, discovery_app)
    commands = [run, discover, *(c.callback for app in apps for c in app.registered_commands)]
    takes = {command.__name__: set(inspect.signature(command).parameters) for command in commands}
    of_a_backend = {name for name, options in takes.items() if "backend" in options}
    assert {"run", "discover", "suite_command", "run_command", "shortlist_command"} <= of_a_backend
    assert {n for n in of_a_backend if not {"via", "base_url", "backend_option"} <= takes[n]} == set()


@pytest.mark.parametrize("budget", ["Chen2020", "Chen2020=x", "Chen2020=0", "Chen2020=1.5", "Chen2020=true"])
def test_a_budget_that_is_no_number_of_simulations_is_refused_before_anything_is_run(budget, tmp_path):
    with pytest.raises(BsaError, match="--own-budget"):
        suite_command(suite="generated", cases="1", own_budget=[budget], out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_suite_that_is_none_is_refused_in_a_line(tmp_path):
    with pytest.raises(BsaError, match="it must be 'published', 'generated', 'random' or 'lives'"):
        suite_command(suite="foo", out=tmp_path / "out")
