"""The configuration of a run from what a person typed."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..core.errors import BsaError, did_you_mean
from ..core.printable import shown
from ..core.run.run_config import RunConfig
from ..core.scaffold import Scaffold, load_scaffold
from ..core.validation import validated
from ..core.yaml_text import parse_yaml


def run_config(
    scaffold: str | Scaffold,
    backend: str,
    backend_options: Mapping[str, Any],
    settings: Mapping[str, Any],
    simulator: str = "",
) -> RunConfig:
    """The checked configuration of a run.

    ``settings`` replace defaults: fields of `RunConfig`, or dotted paths into the scaffold (``feedback.use``);
    ``simulator`` is the task's own, for a scaffold that names none. Raises `BsaError` naming the key at fault and the
    nearest valid one.
    """
    chosen = load_scaffold(scaffold) if isinstance(scaffold, str) else scaffold
    content: dict[str, Any] = {
        "scaffold": chosen.made_for(simulator).model_dump(),
        "backend": backend,
        "backend_options": dict(backend_options),
    }
    for key, value in settings.items():
        path = key.split(".")
        # `warm_up` is a number of simulations, `warm_up.use` a part of the scaffold.
        if path[0] not in RunConfig.model_fields or (len(path) > 1 and not isinstance(content.get(path[0]), dict)):
            if path[0] not in Scaffold.model_fields:
                raise _no_setting(key)
            path = ["scaffold", *path]
        _put(content, path, value, key)
    return validated(RunConfig, content, "run configuration")


def given_budgets(**budgets: int | None) -> dict[str, int]:
    """The budgets that were given; the others are those of `RunConfig`. Raises `BsaError` if one is text."""
    for name, value in budgets.items():
        if isinstance(value, (str, bytes, bool)):
            raise BsaError(f"{name} is {shown(repr(value))}, which is no number.", "give a whole number.")
    return {key: value for key, value in budgets.items() if value is not None}


def backend_options(options: Mapping[str, Any], **given: Any) -> dict[str, Any]:
    """How a language model is reached and asked, as it goes into a configuration: only what was set."""
    said = {key: str(value) if isinstance(value, Path) else value for key, value in given.items() if value is not None}
    return dict(options) | said


def key_texts(pairs: Sequence[str] | None, option: str) -> dict[str, str]:
    """``["a=010", "b=x"]`` as a mapping of texts. Raises `BsaError` if a pair has no ``=``."""
    result: dict[str, str] = {}
    for pair in pairs or ():
        key, sign, value = (part.strip() for part in pair.partition("="))
        if not sign or not key:
            raise BsaError(f'{option} "{pair}" is not key=value.', f'write {option} "key=value".')
        result[key] = value
    return result


def key_values(pairs: Sequence[str] | None, option: str) -> dict[str, Any]:
    """``["a=1", "b=x"]`` as a mapping; values are read as YAML, and stay text where they are none.

    Raises `BsaError` if a pair has no ``=``.
    """
    result: dict[str, Any] = {}
    for key, text in key_texts(pairs, option).items():
        try:
            result[key] = parse_yaml(text, option)
        except BsaError:
            result[key] = text
    return result


def _put(content: dict[str, Any], path: Sequence[str], value: Any, key: str) -> None:
    *parents, last = path
    place: Any = content
    for part in parents:
        if isinstance(place, dict) and part in place and place[part] is None:
            place[part] = {}  # a part of the scaffold that it leaves out
        place = place.get(part) if isinstance(place, dict) else None
        if not isinstance(place, dict):
            raise _no_setting(key)
    place[last] = value


def _no_setting(key: str) -> BsaError:
    given = shown(key)
    first = given.partition(".")[0]
    known = [name for name in (*RunConfig.model_fields, *Scaffold.model_fields) if name != first]
    nearest = did_you_mean(first, known)
    return BsaError(
        f'--set {given}: there is no setting "{given}".',
        f"{nearest} "
        * bool(nearest)
        + f"Settings of a run: {', '.join(RunConfig.model_fields)}; of its scaffold: offers, and simulator, "
        "feedback, memories, warm_up and proposer, each with .use and .options.",
    )
