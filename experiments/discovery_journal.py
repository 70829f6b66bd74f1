"""The journal of a discovery: its first line, and going on with a discovery that was stopped."""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..core.errors import BsaError
from ..core.files import file_digest, file_error
from ..core.printable import shown
from ..core.reading.part_of_file import file_and_part
from ..core.run import journal
from ..core.run.journal import FILE_NAME, FORMAT, Journal, OpenJournal, read_events
from ..core.run.recorded import SIMULATION
from ..core.shape import decoding, shaped
from .discovery_case import DiscoverOptions
from .run import go_on, versions
from .tasks.parameter_source import found_cell, names_a_set

KIND = "discovery"
RESULT = "discovery.json"


@contextmanager
def opened(options: DiscoverOptions) -> Iterator[OpenJournal]:
    """The journal in the discovery's folder, begun or found to be of the same options, records and base model.

    Raises `BsaError` if a file or a run cannot be read, or the folder holds anything else.
    """
    asked = {"options": _dumped(options), "records": _digests(options), **_digests_of_base(options)}
    with journal.opened(options.out, SIMULATION) as found:
        _begin(found.file, found.earlier, asked)
        yield found


def _begin(file: Journal, earlier: list[dict[str, Any]], asked: Mapping[str, Any]) -> None:
    if not earlier:
        file.append("run", format=FORMAT, kind=KIND, versions=versions(), **asked)
        return
    first = earlier[0]
    began = {**_defaults(), **first.get("options", {})}
    # Earlier versions kept no digests of the base model, and the path of a search as it was given.
    base = {name: asked[name] for name in ("parameters", "search")}
    known = {**base, **first, "options": {**began, "search": _absolute(began["search"])}}
    changed = [key for key, value in asked.items() if known.get(key) != value]
    if changed:
        if first.get("kind") != KIND:
            raise BsaError(f"{file.path} belongs to a calibration.", "choose another --out folder.")
        if changed == ["records"]:
            raise _changed_files(file.path, known.get("records", {}), asked["records"])
        what = f"a discovery with other {' and '.join(changed)}"
        instead = (
            "go on with the options that it has: bsa discover --resume FOLDER"
            if "options" in changed
            else "restore what it began with"
        )
        raise BsaError(f"{file.path} belongs to {what}.", f"choose another --out folder, or {instead}.")
    go_on(file, first)


def _changed_files(journal: Path, before: Mapping[str, str], now: Mapping[str, str]) -> BsaError:
    """The refusal of files that are not what they were when the discovery began."""
    changed = [path for path in {**before, **now} if before.get(path) != now.get(path)]
    more = f" ({len(changed) - 1} more have changed)" * (len(changed) > 1)
    return BsaError(
        f"{shown(changed[0], 300)} is not what it was when the discovery in {journal.parent} began{more}.",
        "restore it, or begin a new discovery with another --out folder.",
    )


def _defaults() -> dict[str, Any]:
    """What an option is that a journal does not have yet."""
    fields = DiscoverOptions.model_fields.items()
    return {name: field.get_default(call_default_factory=True) for name, field in fields if not field.is_required()}


def read_options(folder: Path) -> DiscoverOptions:
    """The options of an earlier discovery, from its journal. Raises `BsaError` if the folder holds no discovery."""
    first = next(read_events(folder), {})
    if first.get("kind") != KIND:
        hint = "bsa run --resume goes on with a calibration." if first else "give the folder of an earlier discovery."
        raise BsaError(f"{folder / FILE_NAME} is not the journal of a discovery.", hint)
    with decoding(folder / FILE_NAME, "a discovery", "restore the file, or start a new discovery."):
        found: DiscoverOptions = shaped(DiscoverOptions, {**first["options"], "out": folder})
        return found


def _dumped(options: DiscoverOptions) -> dict[str, Any]:
    """Options as the journal keeps them: paths that mean the same from every folder, and not where results go."""
    content = options.model_dump(mode="json", exclude={"out"})
    for file in (*content["data"], *content["holdout"], *content["reference"]):
        file["path"] = str(Path(file["path"]).absolute())
        file["joined"] = [str(Path(path).absolute()) for path in file["joined"]]
    if (parameters := _path_of_parameters(options)) is not None:
        content["parameters"] = str(parameters.absolute())
    content["search"] = _absolute(content["search"])
    return content


def _path_of_parameters(options: DiscoverOptions) -> Path | None:
    """The file or folder that the base model is of; None where it is an installed set, whatever is called like it."""
    path = Path(options.parameters)
    return path if not names_a_set(options.parameters) and path.exists() else None


def _digests(options: DiscoverOptions) -> dict[str, str]:
    """Digests of all files that are read, by path."""
    given = [file_and_part(path)[0] for file in options.files for path in file.files]
    if (parameters := _path_of_parameters(options)) is not None and parameters.is_file():
        given.append(parameters)
    found: dict[str, str] = {}
    for path in given:
        try:
            files = sorted(child for child in path.iterdir() if child.is_file()) if path.is_dir() else [path]
        except OSError as error:
            raise file_error(error, path) from None
        found |= {str(one.absolute()): file_digest(one) for one in files}
    return found


def _digests_of_base(options: DiscoverOptions) -> dict[str, str]:
    """Digests of the run that the base model comes from and of the file that says what is uncertain; else empty.

    A run that went on may have found other values since, under the same path. By the names of the digests a refusal
    tells what has changed.
    """
    base = found_cell(options.parameters)
    run = "" if base is None else hashlib.sha256(base.parameters.text.encode()).hexdigest()
    file = _search_file(options.search)
    return {"parameters": run, "search": file_digest(file) if file else ""}


def _search_file(search: Any) -> Path | None:
    """The file that says what is uncertain, where it is one and no preset."""
    from ..plugins.pybamm.before_search.uncertain_parameters import PRESETS

    is_file = isinstance(search, str) and search not in PRESETS and Path(search).is_file()
    return Path(search) if is_file else None


def _absolute(search: Any) -> Any:
    """What is uncertain, its file by a path that means the same from every folder."""
    file = _search_file(search)
    return search if file is None else str(file.absolute())
