"""Content of files that may have been damaged or written by others, held to the types that it should have."""

import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import GenericAlias
from typing import Any

from pydantic import BaseModel, TypeAdapter, ValidationError, create_model

from .errors import BsaError

_WRONG = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError, zlib.error)
"""What decoders raise at content of another shape."""


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def shaped(kind: Any, content: Any) -> Any:
    """The content as a value of a type: a dataclass from a mapping with its fields.

    Raises `ValueError` if it is not, with the place.
    """
    try:
        return _adapter(kind).validate_python(content)
    except ValidationError as error:
        raise _in_one_line(error) from None


def mapping_with(**fields: Any) -> type[BaseModel]:
    """The type of a mapping with these fields; one that is given as its type and a value may be missing."""
    given: Any = {name: kind if isinstance(kind, tuple) else (kind, ...) for name, kind in fields.items()}
    made: type[BaseModel] = create_model("Shape", **given)
    return made


def list_of(kind: type) -> Any:
    """The type of a list of such values."""
    return GenericAlias(list, (kind,))


def check_json(kind: Any, text: bytes) -> None:
    """Hold JSON to a type; no number may be text, and no text a number.

    Raises `ValueError` if it is of another type, with the place.
    """
    try:
        _adapter(kind).validate_json(text, strict=True)
    except ValidationError as error:
        raise _in_one_line(error) from None


def _in_one_line(error: ValidationError) -> ValueError:
    first = error.errors(include_url=False)[0]
    place = ".".join(map(str, first["loc"])) or "the whole"
    return ValueError(f'"{place}": {first["msg"]}')


@contextmanager
def decoding(path: Path, wanted: str, hint: str) -> Iterator[None]:
    """Word whatever a decoder raises in this block in one line.

    Raises `BsaError` if the content is of another shape.
    """
    try:
        yield
    except _WRONG as error:
        raise BsaError(f"{path} does not read as {wanted} ({type(error).__name__}: {error}).", hint) from None
