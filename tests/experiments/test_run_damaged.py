"""A journal that was damaged anywhere is read, resumed and replayed, or refused in one line."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from bsa.backends.opening import open_backend
from bsa.backends.replay import replay
from bsa.core.errors import BsaError
from bsa.core.run.journal import FILE_NAME
from bsa.core.run.run_config import RunConfig
from bsa.core.scaffold import PluginChoice, load_scaffold
from bsa.experiments.report.page import build_report
from bsa.experiments.run import execute_run, read_request
from bsa_toy_cell import toy_task
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

VALUES: list[Any] = [None, [], {}, "text", "", -1, 0, 3, 1e308, float("nan"), True, [[]], {"a": 1}]


@pytest.fixture(scope="module")
def lines(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """A whole run's journal."""
    folder = tmp_path_factory.mktemp("runs") / "whole"
    scaffold = load_scaffold("full").model_copy(update={"simulator": PluginChoice(use="toy-cell")})
    config = RunConfig(scaffold=scaffold, rounds=2, warm_up=2, simulations=5)
    execute_run(toy_task(), config, folder, open_backend("rules", {}), report=False, analysing=True)
    return [json.loads(line) for line in (folder / FILE_NAME).read_text().splitlines()]


def places(content: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where every value of a JSON content stands."""
    yield path
    items = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, value in items:
        yield from places(value, (*path, key))


def changed(content: Any, path: tuple[Any, ...], value: Any) -> Any:
    """The content with another value at a place; without the place where the value is `KeyError`."""
    if not path:
        return None if value is KeyError else value
    first, *rest = path
    copy = dict(content) if isinstance(content, dict) else list(content)
    if rest or value is not KeyError:
        copy[first] = changed(content[first], tuple(rest), value)
    else:
        del copy[first]
    return copy


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_one_value_changed_anywhere(data: st.DataObject, lines: list[dict[str, Any]], tmp_path: Path) -> None:
    number = data.draw(st.integers(0, len(lines) - 1))
    path = data.draw(st.sampled_from(list(places(lines[number]))))
    value = data.draw(st.sampled_from([*VALUES, KeyError]))
    folder = tmp_path / "run"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    damaged = [changed(line, path, value) if k == number else line for k, line in enumerate(lines)]
    text = "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in damaged)
    (folder / FILE_NAME).write_text(text)
    for use in (build_report, lambda place: replay(str(place)), _resume):
        try:
            use(folder)
        except BsaError as error:
            assert "\n" not in str(error)  # noqa: PT017  (either is right)


def _resume(folder: Path) -> None:
    task, config = read_request(folder)
    if config.simulations <= 5 and config.rounds <= 3 and config.backend == "rules":
        execute_run(task, config, folder, open_backend(config.backend, {}), report=False, analysing=True)
