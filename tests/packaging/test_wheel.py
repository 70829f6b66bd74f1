"""The wheel holds what the tree holds: a sub-package or data file that is forgotten fails here."""

import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("core", "plugins", "backends", "scaffolds", "experiments", "testing")


def tracked(*suffixes: str) -> set[str]:
    listed = subprocess.run(["git", "ls-files", *ROOMS], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        pytest.skip("not a git checkout, so there is nothing to compare with")
    return {name for name in listed.stdout.splitlines() if Path(name).suffix in suffixes and (ROOT / name).exists()}


def test_every_sub_package_is_listed() -> None:
    listed = set(tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"])
    found = {"bsa", *(f"bsa.{Path(name).parent.as_posix().replace('/', '.')}" for name in tracked(".py"))}
    assert listed == found


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(folder), str(ROOT)]
    # Put together elsewhere: in the tree, what an earlier build left behind would get into the wheel.
    (folder / "elsewhere.cfg").write_text(f"[build]\nbuild_base = {folder / 'build'}\n")
    settings = os.environ | {"DIST_EXTRA_CONFIG": str(folder / "elsewhere.cfg")}
    built = subprocess.run(command, capture_output=True, text=True, check=False, env=settings)
    assert built.returncode == 0, built.stderr
    (path,) = folder.glob("*.whl")
    return zipfile.ZipFile(path)


@pytest.mark.slow
def test_the_wheel_holds_every_module_and_data_file(wheel: zipfile.ZipFile) -> None:
    inside = set(wheel.namelist())
    wanted = tracked(".py", ".yaml", ".csv", ".j2", ".css", ".js")
    assert {f"bsa/{name}" for name in wanted} - inside == set()
    assert "bsa/py.typed" in inside
    assert not any("tests/" in name for name in inside)


@pytest.mark.slow
def test_the_wheel_says_what_it_is(wheel: zipfile.ZipFile) -> None:
    (folder,) = {name.partition("/")[0] for name in wheel.namelist() if ".dist-info/" in name}
    metadata = wheel.read(f"{folder}/METADATA").decode()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert f"\nVersion: {project['version']}\n" in metadata
    assert "\nLicense-Expression: BSD-3-Clause\n" in metadata
    assert "\nLicense-File: LICENSE\n" in metadata
    assert wheel.read(f"{folder}/licenses/LICENSE") == (ROOT / "LICENSE").read_bytes()
