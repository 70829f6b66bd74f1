"""What is wrong with what people wrote, in one line."""

from __future__ import annotations

from pydantic import BaseModel, ValidationError

from .errors import BsaError, did_you_mean
from .redaction import redact


def explain(error: ValidationError, where: str, model: type[BaseModel]) -> BsaError:
    """The first thing that is wrong, as a `BsaError`.

    Parameters
    ----------
    error : pydantic.ValidationError
        What pydantic found.
    where : str
        The file or plugin at fault.
    model : type of pydantic.BaseModel
        What it was checked against, for the nearest valid key.
    """
    # A mistyped key is both missing and unknown; the unknown one tells what was meant.
    first = min(error.errors(include_url=False), key=lambda found: found["type"] != "extra_forbidden")
    path = [str(part) for part in first["loc"]]
    key = ".".join(path) or "the whole"
    more = f" ({error.error_count() - 1} more)" if error.error_count() > 1 else ""
    if first["type"] == "extra_forbidden":
        valid = list(model.model_fields) if len(path) == 1 else []
        hint = did_you_mean(path[-1], valid) or (f"valid keys: {', '.join(valid)}." if valid else "remove it.")
        return BsaError(f'{where}: "{key}" is not a known key{more}.', hint)
    if first["type"] == "missing":
        return BsaError(f'{where}: "{key}" is missing{more}.', "add it.")
    # Before it is cut: half a password is not recognised.
    shown = redact(repr(first.get("input")))
    shown = shown if len(shown) <= 60 else shown[:57] + "..."
    reason = first["msg"].removeprefix("Value error, ")
    return BsaError(f'{where}: "{key}" is {shown}: {reason}{more}.', "")
