"""The journal of a discovery: its first line, and going on with a discovery that was stopped."""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..core.discovery.recorded import SIMULATION
from ..core.errors import BsaError
from ..core.files import file_error
from ..core.printable import shown
from ..core.reading.part_of_file import file_and_part
from ..core.run import journal
from ..core.run.journal import FILE_NAME, FORMAT, Journal, OpenJournal, read_events
from ..core.shape import decoding, shaped
from .discovery_case import DiscoverOptions
from .run import versions

KIND = "discovery"


@contextmanager
def opened(options: DiscoverOptions) -> Iterator[OpenJournal]:
    """The journal in the discovery's folder, begun or found to be of the same options and records.

    Raises `BsaError` if a record cannot be read, or the folder holds anything else.
    """
    asked = {"options": _dumped(options), "records": _digests(options)}
    with journal.opened(options.out, SIMULATION) as found:
        _begin(found.file, found.earlier, asked)
        yield found


def _begin(file: Journal, earlier: list[dict[str, Any]], asked: Mapping[str, Any]) -> None:
    now = versions()
    if not earlier:
        file.append("run", format=FORMAT, kind=KIND, versions=now, **asked)
        return
    first = earlier[0]
    known = {**first, "options": {**_defaults(), **first.get("options", {})}}
    changed = [key for key, value in asked.items() if known.get(key) != value]
    if changed:
        if first.get("kind") != KIND:
            raise BsaError(f"{file.path} belongs to a calibration.", "choose another --out folder.")
        if changed == ["records"]:
            raise _changed_files(file.path, known.get("records", {}), asked["records"])
        raise BsaError(
            f"{file.path} belongs to a discovery with other options.",
            "choose another --out folder, or go on with the options that it has: bsa discover --resume FOLDER.",
        )
    file.append("resumed", versions=now)


def _changed_files(journal: Path, before: Mapping[str, str], now: Mapping[str, str]) -> BsaError:
    """The refusal of files that are not what they were when the discovery began."""
    changed = [
        path for path in (*before, *(path for path in now if path not in before)) if before.get(path) != now.get(path)
    ]
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
    for file in (*content["data"], *content["holdout"]):
        file["path"] = str(Path(file["path"]).absolute())
        file["joined"] = [str(Path(path).absolute()) for path in file["joined"]]
    if Path(options.parameters).exists():
        content["parameters"] = str(Path(options.parameters).absolute())
    return content


def _digests(options: DiscoverOptions) -> dict[str, str]:
    """Digests of all files that are read, by path."""
    given = [file_and_part(path)[0] for file in (*options.data, *options.holdout) for path in file.files]
    if (parameters := Path(options.parameters)).is_file():
        given.append(parameters)
    found: dict[str, str] = {}
    for path in given:
        try:
            files = sorted(child for child in path.iterdir() if child.is_file()) if path.is_dir() else [path]
            found |= {str(one.absolute()): hashlib.sha256(one.read_bytes()).hexdigest() for one in files}
        except OSError as error:
            raise file_error(error, path) from None
    return found
