"""Lets commands share their options: a dataclass of options stands for one parameter of a command."""

import inspect
from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from typing import Any, get_type_hints

Command = Callable[..., Any]


def with_options(group: type, **defaults: Any) -> Callable[[Command], Command]:
    """Give a command the fields of a dataclass as options, at the place of its parameter of that type.

    The fields of the dataclass are annotated as a command's parameters are, each with a default; ``defaults`` are those
    of this command, where they differ from the group's.
    """

    def decorate(command: Command) -> Command:
        own = list(inspect.signature(command, eval_str=True).parameters.values())
        (place,) = (number for number, parameter in enumerate(own) if parameter.annotation is group)
        hints = get_type_hints(group, include_extras=True)
        shared = [
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=defaults.get(field.name, field.default),
                annotation=hints[field.name],
            )
            for field in fields(group)
        ]
        others = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in own]
        signature = inspect.Signature([*others[:place], *shared, *others[place + 1 :]])

        @wraps(command)
        def called(**given: Any) -> Any:
            bound = signature.bind(**given)
            bound.apply_defaults()
            values = dict(bound.arguments)
            chosen = group(**{field.name: values.pop(field.name) for field in fields(group)})
            return command(**{own[place].name: chosen}, **values)

        called.__signature__ = signature  # type: ignore[attr-defined]
        called.__annotations__ = {p.name: p.annotation for p in signature.parameters.values()}
        return called

    return decorate
