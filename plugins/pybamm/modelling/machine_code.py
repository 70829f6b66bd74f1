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
from collections.abc import Sequence
from pathlib import Path

import casadi

_FLAGS = ("-shared", "-fPIC", "-O1", "-ffp-contract=off", "-fno-builtin")
"""The last two keep every operation as CasADi carries it out. `-O2` and `-O3` take two to four times as long to compile
and gain a tenth at most."""

_SECONDS_A_CHARACTER = 3e-6
"""What compiling takes: 0.6 s for the 240,000 characters of SPMe, 4.2 s for the 1.3 million of DFN."""

_MOST_CHARACTERS = 2_000_000
"""What is longer stays interpreted: compilers take more than proportionally long for long functions, and a life with
side reactions over its cycles was not compiled within two minutes."""

_PATIENCE = 4
"""Compiling is given up when it has taken so many times as long."""

_SAVED = 0.25
"""Share of an interpreted simulation that machine code saves: 0.4 with SPMe, 0.17 with DFN. Like the price it decides
when compiling begins, and nothing else. With 1 in its place a task of 50 simulations compiled a model for every kind of
step, and took half as long again."""

_COMPILERS = ("gcc", "cc", "clang")


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
    """Some functions of a model, interpreted at first, later as machine code.

    Compiling begins once machine code would have saved what compiling takes: so all takes at most a quarter longer than
    the better choice would have, however many simulations follow.

    Parameters
    ----------
    functions : sequence of str
        The functions, as CasADi serialises them.
    """

    def __init__(self, functions: Sequence[str]) -> None:
        self._functions = tuple(functions)
        self._spent_s = 0.0
        self._source: str | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._over = False  # Made, or given up.

    def spent(self, seconds: float) -> None:
        """Note what a simulation took, s; compiling may begin."""
        if self._over or self._process is not None:
            return
        self._spent_s += seconds
        if self._source is None:
            self._source = self._generated()
        if self._source and _SAVED * self._spent_s > _SECONDS_A_CHARACTER * len(self._source):
            self._begin(self._source)
            self._source = ""

    def made(self) -> list[str] | None:
        """The functions as machine code, serialised, in their order; None unless they have just been made."""
        if self._over or self._process is None or self._process.poll() is None:
            return None
        self._over = True
        assert self._folder is not None
        try:
            if self._process.returncode == 0:
                library = str(self._library)
                names = (casadi.Function.deserialize(text).name() for text in self._functions)
                return [str(casadi.external(name, library).serialize()) for name in names]
        except RuntimeError:  # The folder may be one from which no code may be run.
            pass
        self.drop()
        return None

    def drop(self) -> None:
        """Remove the library's file: once loaded, it is not needed."""
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    @property
    def _library(self) -> Path:
        assert self._folder is not None
        return Path(self._folder.name) / "functions.so"

    def _generated(self) -> str:
        """The functions in C; empty where there is no compiler, no C for them, or too much of it."""
        if compiler() is None:
            self._over = True
            return ""
        generator = casadi.CodeGenerator("functions", {"with_header": False})
        try:
            for text in self._functions:
                generator.add(casadi.Function.deserialize(text))
            source = str(generator.dump())
        except RuntimeError:
            source = ""
        if not 0 < len(source) <= _MOST_CHARACTERS:
            self._over = True
            return ""
        return source

    def _begin(self, source: str) -> None:
        program = compiler()
        if program is None:
            self._over = True
            return
        try:
            self._folder = tempfile.TemporaryDirectory(prefix="bsa-", ignore_cleanup_errors=True)
            most_s = math.ceil(_PATIENCE * _SECONDS_A_CHARACTER * len(source))
            limited = ["sh", "-c", f'ulimit -t {most_s} && exec "$@"', "sh"]
            self._process = subprocess.Popen(
                [*limited, program, *_FLAGS, "-x", "c", "-", "-o", str(self._library)],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        except OSError:
            self._over = True
            return
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError), self._process.stdin as pipe:
            pipe.write(source.encode())
