"""A person at the terminal, or in a notebook."""

import sys
from typing import TextIO

from ..core.messages import BudgetSpent


class Terminal:
    """Standard input and standard error, unless another ``source`` and ``target`` are given."""

    def __init__(self, source: TextIO | None = None, target: TextIO | None = None) -> None:
        self._source = source
        self._target = target

    @property
    def has_screen(self) -> bool:
        """Whether an editor can be opened; a notebook has none, whatever its environment names."""
        return self._source is None and sys.stdin.isatty()

    def say(self, text: str) -> None:
        """Show a text."""
        print(text, file=self._target or sys.stderr, flush=True)

    def line(self) -> str:
        """The next line, with its end. Raises `BudgetSpent` at the end of the input, so that a run stops cleanly."""
        try:
            # A notebook has no standard input to read from, but asks for what `input` wants.
            line = f"{input()}\n" if self._source is None else self._source.readline()
        except (EOFError, NotImplementedError):  # the latter where a notebook is run without anybody
            line = ""
        if not line:
            raise BudgetSpent("the input ended: nobody answers any more")
        return line
