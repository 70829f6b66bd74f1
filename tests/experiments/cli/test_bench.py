import inspect

from bsa.experiments.cli.bench import bench_app


def test_every_study_of_a_suite_can_be_told_where_the_published_tasks_are():
    takes = {c.callback.__name__: set(inspect.signature(c.callback).parameters) for c in bench_app.registered_commands}
    of_a_suite = {name for name, options in takes.items() if "suite" in options}
    assert len(of_a_suite) >= 4
    assert {name for name in of_a_suite if "published" not in takes[name]} == set()
