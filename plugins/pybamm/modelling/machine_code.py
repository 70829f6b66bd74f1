"""Functions of a compiled model as machine code, made in the background by the system's C compiler.

CasADi interprets the functions of a model, which takes about half of a simulation with SPMe and a fifth with DFN. As
machine code they give the same numbers to the last bit, so that nothing depends on when they are exchanged.

PyBaMM's own option ``compile`` makes machine code before the first simulation, with flags that change last digits, and
keeps it in a folder of the system that other users can write to.
"""

import contextlib
import math
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

import casadi

from .scratch import scratch_folder

_FLAGS = ("-shared", "-fPIC", "-O1", "-ffp-contract=off", "-fno-builtin")
"""The last two keep every operation as CasADi carries it out. `-O2` and `-O3` take two to four times as long to compile
and gain a tenth at most."""

_SECONDS_A_CHARACTER = 1.5e-6
"""What compiling takes, by the length of the functions as CasADi serialises them: 0.6 s for the 420,000 characters of
SPMe, 3 to 4 s for the 2.3 million of DFN."""

_MOST_CHARACTERS = 4_000_000
"""What is longer stays interpreted: 4.5 million (DFN with a particle-size distribution) took 22 s, three times as long
as in proportion."""

_PATIENCE = 4
"""Compiling is given up when it has taken so many times as long."""

_SAVED = 0.25
"""Share of an interpreted simulation that machine code saves: 0.4 with SPMe, 0.17 with DFN. Like the price it decides
when compiling begins, and nothing else. With 1 in its place a task of 50 simulations compiled a model for every kind of
step, and took half as long again."""

_COMPILERS = ("gcc", "cc", "clang")

T = TypeVar("T")


def compiler() -> str | None:
    """The C compiler that is used, None for none.

    The environment variable ``BSA_COMPILER`` names another, or none if it is empty. On systems other than Linux only a
    compiler that it names is used: on others a ``gcc`` may be a stub that asks for an installation.
    """
    named = os.environ.get("BSA_COMPILER")
    if named is not None:
        return shutil.which(named) if named else None
    if sys.platform != "linux":
        return None
    return next((found for found in map(shutil.which, _COMPILERS) if found), None)


class MachineCode:
    """Some functions of a model, as CasADi serialises them; interpreted at first, later as machine code.

    Compiling begins once machine code would have saved what compiling takes: so all takes at most a quarter longer than
    the better choice would have, however many simulations follow.
    """

    def __init__(self, functions: Sequence[str]) -> None:
        self._functions = tuple(functions)
        length = sum(map(len, self._functions))
        self._price_s = _SECONDS_A_CHARACTER * length
        self._spent_s = 0.0
        # None from the beginning of compiling on.
        self._compiler = compiler() if length <= _MOST_CHARACTERS else None
        self._process: subprocess.Popen[bytes] | None = None  # While compiling.
        self._folder: tempfile.TemporaryDirectory[str] | None = None  # While compiling.

    def spent(self, seconds: float) -> None:
        """Note what a simulation took, s; compiling may begin."""
        if self._compiler is None:
            return
        self._spent_s += seconds
        if _SAVED * self._spent_s > self._price_s:
            program, self._compiler = self._compiler, None
            # Without C for a function, or room on the disk, all stays interpreted.
            with contextlib.suppress(RuntimeError, OSError):
                self._begin(program)

    def made(self, load: Callable[[str], T]) -> list[T] | None:
        """The functions as machine code, in their order, as ``load`` makes them of what CasADi serialises.

        None unless they have just been made.
        """
        if self._process is None or self._process.poll() is None:
            return None
        process, folder, self._process, self._folder = self._process, self._folder, None, None
        assert folder is not None
        # Once loaded, the library's file is not needed.
        with folder as name:
            if process.returncode != 0:
                return None
            try:
                compiled = [casadi.external(function.name(), _library(name)) for function in self._deserialised()]
                return [load(str(one.serialize())) for one in compiled]
            except RuntimeError:  # The folder may be one from which no code may be run.
                return None

    def _deserialised(self) -> Iterator[casadi.Function]:
        return map(casadi.Function.deserialize, self._functions)

    def _begin(self, program: str) -> None:
        generator = casadi.CodeGenerator("functions", {"with_header": False})
        for function in self._deserialised():
            generator.add(function)
        source = str(generator.dump()).encode()
        self._folder = scratch_folder()
        limited = ["sh", "-c", f'ulimit -t {math.ceil(_PATIENCE * self._price_s)} && exec "$@"', "sh"]
        self._process = subprocess.Popen(
            [*limited, program, *_FLAGS, "-x", "c", "-", "-o", _library(self._folder.name)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError), self._process.stdin as pipe:
            pipe.write(source)


def _library(folder: str) -> str:
    return str(Path(folder) / "functions.so")
