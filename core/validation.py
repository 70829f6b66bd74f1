"""What is wrong with what people wrote, in one line."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from .errors import BsaError, did_you_mean
from .redaction import redact

_NO_MAPPING = ("model_type", "dict_type", "model_attributes_type", "dataclass_type")
"""What pydantic calls a value where keys with values should be; its words name Python's classes."""

_QUOTED = re.compile(r"'([^']*)'")

_LENGTH = re.compile(r"^(?:Tuple|List) should have (at \w+) (\d+) items?.*$")

_EXPECTED = {
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number was expected"),
    **dict.fromkeys(("float_type", "float_parsing"), "a number was expected"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false was expected"),
    **dict.fromkeys(("string_type", "path_type"), "text was expected"),
    **dict.fromkeys(("list_type", "tuple_type"), "a list was expected"),
    "finite_number": "a finite number was expected",
    "greater_than_equal": "it must be {ge} or more",
    "greater_than": "it must be more than {gt}",
    "less_than_equal": "it must be {le} or less",
    "less_than": "it must be less than {lt}",
    "literal_error": "it must be {expected}",
}
"""What a kind of error of pydantic's means; its own words tell of types and parsing."""

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
    found_wrong = _of_the_kind_meant(error.errors(include_url=False))
    # A mistyped key is both missing and unknown; the unknown one tells what was meant.
    first = min(found_wrong, key=lambda found: found["type"] != "extra_forbidden")
    path = [str(part) for part in first["loc"]]
    key = ".".join(path)
    more = f" ({len(found_wrong) - 1} more)" if len(found_wrong) > 1 else ""
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
    reason = reason_of(first)
    hint = did_you_mean(first["input"], _allowed(first)) if isinstance(first.get("input"), str) else ""
    return BsaError(f"{where}: {found}: {reason}{more}.", hint)


def reason_of(found: Mapping[str, Any]) -> str:
    """Why a value is refused, in a few words."""
    if found["type"] in _EXPECTED:
        return _EXPECTED[found["type"]].format(**found.get("ctx", {}))
    return _LENGTH.sub(r"a list should have \1 \2 entries", str(found["msg"]).removeprefix("Value error, "))


def _of_the_kind_meant(found: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """What is wrong where a name or a mapping may stand and a mapping does: not that it is no name.

    Behind the place, pydantic names the kind that it tried; nobody wrote that word, and it is left out.
    """
    mappings = [one["loc"][:-1] for one in found if one["type"] == "string_type" and isinstance(one["input"], dict)]
    kept: list[dict[str, Any]] = []
    for one in found:
        place = next((place for place in mappings if one["loc"][: len(place)] == place), None)
        if place is None:
            kept.append(dict(one))
        elif len(one["loc"]) > len(place) + 1:
            kept.append({**one, "loc": (*place, *one["loc"][len(place) + 1 :])})
    return kept or [dict(one) for one in found]


def _allowed(found: Mapping[str, Any]) -> list[str]:
    """The words that may stand where another one does."""
    expected = found.get("ctx", {}).get("expected", "") if found["type"] == "literal_error" else ""
    return _QUOTED.findall(expected)


def _keys_at(model: type[BaseModel], path: list[str]) -> list[str]:
    """The valid keys at a place inside what a model describes; none where another kind of thing stands on the way."""
    models = [model]
    for part in path:
        if not part.isdigit():  # a place in a list
            fields = [one.model_fields[part] for one in models if part in one.model_fields]
            models = [inner for field in fields for inner in _models_in(field.annotation)]
    return [name for one in models for name in one.model_fields]


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models_in(part)]
