import sys
import time
import tomllib
from pathlib import Path

import bsa
import pytest
from bsa.experiments.cli.main import main, run_main

VERSION = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]["version"]


def test_the_package_has_its_version() -> None:
    assert bsa.__version__ == VERSION
    with pytest.raises(AttributeError, match="no attribute 'version'"):
        _ = bsa.version


@pytest.mark.parametrize(
    ("command", "arguments"),
    [(main, ["bsa", "--version"]), (run_main, ["bsa-run", "--version"]), (main, ["bsa", "run", "--version"])],
)
def test_a_command_tells_the_version(command, arguments, capsys, monkeypatch) -> None:
    monkeypatch.setattr(sys, "argv", arguments)
    began = time.process_time()
    with pytest.raises(SystemExit) as caught:
        command()
    assert time.process_time() - began < 1
    assert not caught.value.code
    assert capsys.readouterr().out == f"{VERSION}\n"
