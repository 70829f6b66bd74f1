"""What `import bsa` offers, and what it costs."""

import subprocess
import sys

import bsa
import pytest


def test_all_holds_the_public_names() -> None:
    assert sorted(bsa.__all__) == bsa.__all__
    assert set(bsa.__all__) == set(bsa._HOME)
    assert {name for name in dir(bsa) if name in bsa.__all__} == set(bsa.__all__)


@pytest.mark.parametrize("name", bsa.__all__)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    assert getattr(bsa, name).__doc__


def test_the_import_is_fast_and_loads_no_library() -> None:
    heavy = "{'pybamm', 'pydantic', 'numpy', 'scipy', 'pandas', 'matplotlib', 'litellm', 'tqdm'}"
    subprocess.run([sys.executable, "-c", f"import bsa, sys; assert not {heavy} & set(sys.modules)"], check=True)


@pytest.mark.slow
def test_the_functions_are_there_without_the_simulator() -> None:
    code = "import sys; from bsa import calibrate, read_record, Task; assert 'pybamm' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_module_is_the_command() -> None:
    done = subprocess.run([sys.executable, "-m", "bsa", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == bsa.__version__
