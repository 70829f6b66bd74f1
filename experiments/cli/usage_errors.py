"""What is wrong with a command line, said as every other mistake is."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast

import typer
from typer.core import TyperGroup

from ...core.errors import BsaError, did_you_mean, unknown

_UsageError = cast("type[Exception]", typer.BadParameter.__mro__[1])
"""What the library raises for a wrong command line. Releases differ in where it stands, and none exports it."""

_NO_COMMAND = re.compile(r"No such command '(.*?)'")
_NO_CHOICE, _QUOTED = re.compile(r" is not one of (.*)"), re.compile(r"'([^']*)'")
_TOO_MANY = re.compile(r"unexpected extra arguments?(?:\(s\))? \((.*)\)")


class UsageGroup(TyperGroup):
    """A group of commands; whatever is wrong with a command line is a `BsaError`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """See `TyperGroup`."""
        with usage_refused():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """See `TyperGroup`."""
        with usage_refused():
            return super().invoke(ctx)


@contextmanager
def usage_refused() -> Iterator[None]:
    """Raise a `BsaError` where a command line is wrong."""
    try:
        yield
    except _UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # no mistake: its text is the help page
            raise
        raise _explained(error) from error


def option_or_argument(parameter: Any) -> str:
    """What a person calls a parameter of a command: ``"--seed"``, or ``"TASK"`` for an argument."""
    longest: str = max(parameter.opts, key=len, default="")
    return longest if longest.startswith("-") else str(parameter.name).upper()


def _explained(error: Any) -> BsaError:
    """The library's own errors tell kinds apart by their attributes and, for some, by their text alone."""
    context, parameter, option = error.ctx, getattr(error, "param", None), getattr(error, "option_name", "")
    path = context.command_path if context is not None else "the command"
    help_page = f"{context.command_path if context is not None else 'bsa'} --help shows how it is called."
    if option and "does not take a value" in error.message:
        return BsaError(f"{option} takes no value.", f"write {option} alone.")
    if option and "requires" in error.message:
        return BsaError(f"{option} has no value.", "write it behind the option.")
    if option:
        known = [name for one in context.command.params for name in (*one.opts, *one.secondary_opts)]
        message = f"{path} has no option {option}."
        return BsaError(message, did_you_mean(option, [name for name in known if name.startswith("--")]) or help_page)
    if parameter is not None:
        return _of_parameter(error, parameter, path, help_page)
    if found := _NO_COMMAND.search(error.message):
        name = found.group(1)
        return unknown(
            f'{path} has no command "{name}".', name, context.command.list_commands(context), "commands: {}."
        )
    if found := _TOO_MANY.search(error.message):
        return BsaError(
            f'{path} takes no further argument, but got "{found.group(1)}".',
            f"{help_page} An option that takes several values is repeated.",
        )
    return BsaError(f"{path}: {error.format_message()}", help_page)


def _of_parameter(error: Any, parameter: Any, path: str, help_page: str) -> BsaError:
    """A value that is missing or cannot be read; the hint says what the option takes."""
    from pydantic import ValidationError

    from ...core.validation import reason_of

    name = option_or_argument(parameter)
    if hasattr(error, "param_type"):
        return BsaError(f"{path}: {name} is missing.", help_page)
    words = str(getattr(parameter, "help", None) or "")
    taken = " ".join(filter(None, [name, parameter.metavar]))
    hint = f"{taken}: {words}" if words else help_page
    if isinstance(error.__cause__, ValidationError):
        first = error.__cause__.errors(include_url=False)[0]
        given, reason = str(first["input"]), reason_of(first).rstrip(".")
        if found := _NO_CHOICE.search(reason):
            message = f'{name} is "{given}", which is none of its values.'
            return unknown(message, given, _QUOTED.findall(found.group(1)))
        return BsaError(f'{name} is "{given}": {reason}.', hint)
    return BsaError(f"{name}: {error.message.rstrip('.')}.", hint)
