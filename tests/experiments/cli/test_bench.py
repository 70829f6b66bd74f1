import inspect

from bsa.experiments.cli.bench import bench_app
from bsa.experiments.cli.discover import discover
from bsa.experiments.cli.run import run


def test_every_study_of_a_suite_can_be_told_where_the_published_tasks_are():
    takes = {c.callback.__name__: set(inspect.signature(c.callback).parameters) for c in bench_app.registered_commands}
    of_a_suite = {name for name, options in takes.items() if "suite" in options}
    assert len(of_a_suite) >= 4
    assert {name for name in of_a_suite if "published" not in takes[name]} == set()


def test_every_command_that_takes_a_backend_can_be_told_how_to_reach_it():
    commands = [run, discover, *(c.callback for c in bench_app.registered_commands)]
    takes = {command.__name__: set(inspect.signature(command).parameters) for command in commands}
    of_a_backend = {name for name, options in takes.items() if "backend" in options}
    assert {"run", "discover", "suite_command", "discovery_command"} <= of_a_backend
    assert {n for n in of_a_backend if not {"via", "base_url", "backend_option"} <= takes[n]} == set()
