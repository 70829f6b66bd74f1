"""Several files after one option, as the shell's ``*.csv`` gives them."""

from collections.abc import Sequence
from typing import Any

from typer.core import TyperCommand

from ...core.errors import BsaError
from ...core.reading.part_of_file import file_and_part
from ...core.run.journal import FILE_NAME
from .usage_errors import usage_refused


class RecordsCommand(TyperCommand):
    """A command whose record options take all the files that follow."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """See `TyperCommand`."""
        with usage_refused():
            return super().parse_args(ctx, one_option_a_file(args))


def one_option_a_file(arguments: Sequence[str]) -> list[str]:
    """``--data a.csv b.csv`` written as ``--data a.csv --data b.csv``.

    What follows and cannot be a record (the name of a task, a task file) stays an argument of its own.
    """
    written: list[str] = []
    option, awaits_value = "", False
    for place, argument in enumerate(arguments):
        if argument == "--":
            return [*written, *arguments[place:]]
        if argument.startswith("-"):
            if awaits_value:
                raise BsaError(f"{option} has no value.", "give one file at least behind it.")
            name, sign, _ = argument.partition("=")
            option = name if name in ("--data", "--holdout", "--reference") else ""
            awaits_value = bool(option) and not sign
        elif awaits_value:
            awaits_value = False
        elif option and _may_be_a_record(argument):
            written.append(option)
        else:
            option = ""
        written.append(argument)
    return written


def _may_be_a_record(argument: str) -> bool:
    from ..tasks.task_file import is_task_file

    path, _ = file_and_part(argument)
    if (path / FILE_NAME).is_file():  # a run, whose name has a point
        return False
    return not is_task_file(path) and (bool(path.suffix) or path.is_file())
