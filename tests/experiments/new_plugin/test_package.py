"""A package that `bsa new-plugin` wrote is complete: it installs, and its own tests pass."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from bsa.core.contracts.kinds import KINDS, Kind
from bsa.core.contracts.registry import installed
from bsa.core.errors import BsaError
from bsa.experiments.new_plugin.package import package_files, write_package

Install = Callable[..., Path]

PAGE = (Path(__file__).parents[3] / "docs" / "plugins.md").read_text()
DOCUMENTED: dict[Kind, str] = {
    "simulator": "ohmic",
    "feedback": "verdict",
    "memory": "notebook",
    "proposer": "walk",
    "warm-up": "corners",
    "backend": "echo",
    "route": "program",
    "reader": "ticks",
    "effect": "meter-drift",
    "task": "pulse",
}
"""The examples of the page."""


@pytest.mark.parametrize("kind", KINDS)
def test_the_module_is_the_example_of_the_page(kind: Kind) -> None:
    name = DOCUMENTED[kind]
    files = package_files(kind, name, simulator="ohmic")
    title, _, code = files[f"bsa_{name.replace('-', '_')}.py"].partition("\n\n")
    article = "An" if kind == "effect" else "A"
    assert title == f'"""{article} {kind} for battery-sim-agent: {name}."""'
    assert f"```python\n{code}```" in PAGE


@pytest.mark.parametrize("kind", KINDS)
def test_the_plugin_can_be_used(kind: Kind, stranger: Install) -> None:
    stranger(package_files(kind, "my-own")["bsa_my_own.py"], "bsa-my-own")
    assert installed().find(kind, "my-own").origin == "bsa-my-own 0.1"
    assert installed().unusable == []


@pytest.mark.parametrize("kind", KINDS)
def test_the_files_are_well_formed(kind: Kind, tmp_path: Path) -> None:
    for path in write_package(kind, "my-own", tmp_path / "package"):
        assert path.read_text().endswith("\n")
    command = [
        sys.executable,
        "-m",
        "ruff",
        "check",
        "--isolated",
        "--no-cache",
        "--select",
        "E,F,I,B",
        "--line-length",
    ]
    done = subprocess.run([*command, "130", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_the_tests_of_every_package_pass(tmp_path: Path) -> None:
    packages = [tmp_path / kind for kind in KINDS]
    for kind, package in zip(KINDS, packages, strict=True):
        write_package(kind, f"my-{kind}", package)
    site = tmp_path / "site-packages"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    done = subprocess.run(
        [*pip, "--target", str(site), *map(str, packages)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")])}
    pytest_ = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "--import-mode=importlib",
        "-c",
        os.devnull,
    ]
    done = subprocess.run(
        [*pytest_, *(str(package / "tests") for package in packages)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stdout
    assert int(re.findall(r"(\d+) passed", done.stdout)[0]) >= 5 * len(KINDS)
    assert "bsa_my" not in done.stdout.partition("warnings summary")[2], done.stdout


@pytest.mark.parametrize(
    ("kind", "name", "words"),
    [
        ("simulater", "mine", 'did you mean "simulator"?'),
        ("memory", "My Memory", "cannot be named 'My Memory'"),
        ("effect", "class", "cannot be named 'class', which is a keyword of Python"),
        ("reader", "../x", "cannot be named"),
        ("memory", "history", 'the name "history" is taken by battery-sim-agent'),
        ("task", "demo", 'the name "demo" is taken by battery-sim-agent'),
        ("task", "regular-7", 'the name "regular-7" is taken by battery-sim-agent'),
    ],
)
def test_what_cannot_be_written_is_refused(kind: str, name: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(BsaError) as raised:
        write_package(kind, name, tmp_path / "package")
    assert words in str(raised.value)
    assert not (tmp_path / "package").exists()


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("mine")
    with pytest.raises(BsaError, match="is not empty"):
        write_package("memory", "mine", tmp_path)
    assert (tmp_path / "README.md").read_text() == "mine"
