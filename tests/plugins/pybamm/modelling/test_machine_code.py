"""A model that is solved often is solved by machine code, and gives the same numbers."""

import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest
from bsa.core.task import CellModel
from bsa.core.trajectory import FloatArray, Trajectory
from bsa.plugins.pybamm.modelling import machine_code
from bsa.plugins.pybamm.modelling.compiled_cell import Start
from bsa.plugins.pybamm.modelling.machine_code import MachineCode, compiler
from bsa.plugins.pybamm.solving.driven_cell import DrivenCell

COMPILER = next((name for name in machine_code._COMPILERS if shutil.which(name)), None)

needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler on this machine")

CLOCK = np.arange(0.0, 1200.0, 20.0)


@pytest.fixture(autouse=True)
def _with_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BSA_COMPILER", COMPILER or "")


def functions() -> list[str]:
    x = casadi.MX.sym("x", 3)
    return [
        str(casadi.Function(name, [x], [value]).serialize())
        for name, value in (("first", casadi.exp(x)), ("second", 2.0 * x[:2]))
    ]


def waited_for(code: MachineCode) -> list[Any] | None:
    for _ in range(600):
        made = code.made(casadi.Function.deserialize)
        if code._process is None:
            return made
        time.sleep(0.05)
    raise AssertionError("the compiler did not end within 30 s")


def begun(monkeypatch: pytest.MonkeyPatch) -> MachineCode:
    monkeypatch.setattr(machine_code, "_SAVED", 1e9)
    code = MachineCode(functions())
    code.spent(1e-3)
    return code


@pytest.fixture(scope="module")
def cell(rest_then_discharge: Callable[..., Trajectory]) -> DrivenCell:
    record = rest_then_discharge(CLOCK, 100.0, 5.0)
    return DrivenCell(CellModel("Chen2020", "SPMe"), (), record, {}, Start(temperature_k=298.15))


def voltage(cell: DrivenCell) -> FloatArray:
    curve = cell.solve({}, CLOCK, np.zeros(len(CLOCK)), soc=0.7)
    assert curve is not None
    return curve.voltage


@pytest.mark.slow
@needs_compiler
def test_a_model_gives_the_same_voltage_to_the_last_bit(cell: DrivenCell, monkeypatch: pytest.MonkeyPatch) -> None:
    interpreted = voltage(cell)
    monkeypatch.setattr(machine_code, "_SAVED", 1e9)
    voltage(cell)  # compiling begins
    code = cell._solver._code
    assert code._process.wait(30) == 0
    parts = dict(cell._solver._parts)
    compiled = voltage(cell)
    assert cell._solver._parts["rhs_alg"] is not parts["rhs_alg"]
    assert cell._solver._parts["var_fcns"][0] is not parts["var_fcns"][0]
    np.testing.assert_array_equal(compiled, interpreted)


@needs_compiler
def test_functions_are_the_same_ones_in_their_order(monkeypatch: pytest.MonkeyPatch) -> None:
    code = begun(monkeypatch)
    made = waited_for(code)
    assert made is not None
    first, second = made
    x = np.array([0.1, 0.2, 0.3])
    np.testing.assert_array_equal(first(x).full().ravel(), np.exp(x))
    np.testing.assert_array_equal(second(x).full().ravel(), 2.0 * x[:2])
    assert code.made(casadi.Function.deserialize) is None, "they are told once"


@needs_compiler
def test_nothing_is_left_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code = begun(monkeypatch)
    assert list(tmp_path.iterdir())
    made = waited_for(code)
    assert made is not None
    assert not list(tmp_path.iterdir())
    assert float(made[0](np.zeros(3))[0]) == 1.0


def test_compiling_begins_when_it_would_have_paid(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BSA_COMPILER", "true")
    code = MachineCode(functions())
    price = machine_code._SECONDS_A_CHARACTER * sum(map(len, functions()))
    code.spent(0.9 * price / machine_code._SAVED)
    assert code._process is None
    code.spent(0.2 * price / machine_code._SAVED)
    assert code._process is not None


@pytest.mark.parametrize("program", ["false", "true"])
def test_a_compiler_that_fails_or_makes_nothing_changes_nothing(
    program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BSA_COMPILER", program)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code = begun(monkeypatch)
    assert waited_for(code) is None
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("program", ["", "no-such-compiler-zz"])
def test_without_a_compiler_nothing_is_begun(program: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BSA_COMPILER", program)
    code = begun(monkeypatch)
    code.spent(1e3)
    assert code._process is None
    assert code.made(casadi.Function.deserialize) is None


def test_long_functions_stay_interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BSA_COMPILER", "true")
    monkeypatch.setattr(machine_code, "_MOST_CHARACTERS", 100)
    code = begun(monkeypatch)
    code.spent(1e3)
    assert code._process is None


@pytest.mark.slow
def test_compiling_without_an_end_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    endless = tmp_path / "endless"
    endless.write_text("#!/bin/sh\nwhile :; do :; done\n")
    endless.chmod(0o755)
    monkeypatch.setenv("BSA_COMPILER", str(endless))
    code = begun(monkeypatch)
    process = code._process
    assert waited_for(code) is None
    assert process.returncode != 0


def test_on_other_systems_a_compiler_has_to_be_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("BSA_COMPILER", raising=False)
    monkeypatch.setattr("sys.platform", "darwin")
    assert compiler() is None
    monkeypatch.setenv("BSA_COMPILER", "true")
    assert compiler() is not None
