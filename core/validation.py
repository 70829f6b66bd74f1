"""What is wrong with what people wrote, in one line."""

import re
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from .errors import BsaError, did_you_mean
from .redaction import redact

_NO_MAPPING = ("model_type", "dict_type", "model_attributes_type", "dataclass_type")
"""What pydantic calls a value where keys with values should be; its words name Python's classes."""

_LENGTH = re.compile(r"^(?:Tuple|List) should have (at \w+) (\d+) items?.*$")


Model = TypeVar("Model", bound=BaseModel)


def validated(model: type[Model], content: Any, where: str) -> Model:
    """What a person wrote, as a model; ``where`` is the file or plugin at fault. Raises `BsaError` if it is none."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise explain(error, where, model) from None


def explain(error: ValidationError, where: str, model: type[BaseModel]) -> BsaError:
    """The first thing that is wrong, as a `BsaError`.

    ``where`` is the file or plugin at fault, ``model`` what it was checked against, for the nearest valid key.
    """
    # A mistyped key is both missing and unknown; the unknown one tells what was meant.
    first = min(error.errors(include_url=False), key=lambda found: found["type"] != "extra_forbidden")
    path = [str(part) for part in first["loc"]]
    key = ".".join(path)
    more = f" ({error.error_count() - 1} more)" if error.error_count() > 1 else ""
    if first["type"] == "extra_forbidden":
        valid = _keys_at(model, path[:-1])
        hint = did_you_mean(path[-1], valid) or (f"valid keys: {', '.join(valid)}." if valid else "remove it.")
        return BsaError(f'{where}: "{key}" is not a known key{more}.', hint)
    if first["type"] == "missing":
        return BsaError(f'{where}: "{key}" is missing{more}.', "add it.")
    # Before it is cut: half a password is not recognised.
    shown = redact(repr(first.get("input")))
    shown = shown if len(shown) <= 60 else shown[:57] + "..."
    found = f'"{key}" is {shown}' if path else shown
    if first["type"] in _NO_MAPPING:
        keys = "" if path else f": {', '.join(model.model_fields)}"
        return BsaError(
            f"{where}: {found}: keys with values were expected{more}.", f'write one "key: value" a line{keys}.'
        )
    reason = _LENGTH.sub(r"a list should have \1 \2 entries", first["msg"].removeprefix("Value error, "))
    return BsaError(f"{where}: {found}: {reason}{more}.", "")


def _keys_at(model: type[BaseModel], path: list[str]) -> list[str]:
    """The valid keys at a place inside what a model describes; none where another kind of thing stands on the way."""
    for part in path:
        field = model.model_fields.get(part)
        inner = None if field is None else field.annotation
        if not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return []
        model = inner
    return list(model.model_fields)
