"""Writes files whole or not at all, never through a link, and says in one line why a file cannot be used."""

import csv
import errno
import hashlib
import io
import json
import os
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from .errors import BsaError
from .json_object import json_object
from .printable import shown

_DRAFT = ".bsa-draft"
"""Ending of a file that is being written; one that a killed process left holds nothing of worth."""

_HINTS = {
    errno.ENOSPC: "make room on the disk.",
    errno.EDQUOT: "make room in your quota.",
    errno.EROFS: "choose a place that can be written to.",
    errno.EACCES: "check the rights of the path, or choose another.",
    errno.EPERM: "check the rights of the path, or choose another.",
    errno.ENAMETOOLONG: "choose a shorter name.",
    errno.ENOTDIR: "part of the path is a file; choose another path.",
    errno.EISDIR: "it is a folder; give a file.",
    errno.EEXIST: "something else has this name; choose another path.",
    errno.ELOOP: "it is a link; give the path of a file itself.",
    errno.EMFILE: "raise the limit of open files (ulimit -n).",
}


def file_error(error: OSError, path: Path | str | None = None) -> BsaError:
    """What the operating system refuses, with the path and a hint.

    ``path`` is given where the error does not name the one that a person knows.
    """
    where = path if path is not None else error.filename
    what = "the operating system refuses" if where is None else f"{where} cannot be used"
    return BsaError(
        f"{what}: {error.strerror or str(error) or type(error).__name__}.",
        _HINTS.get(error.errno or 0, "check the path."),
    )


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """A new file that takes the place of ``path`` when the block ends well.

    The draft lies in the same folder under a name that nobody can foresee, and is made anew: neither a link at its
    name nor one at ``path`` is followed. The folder is made if missing.

    Raises `BsaError` if the file cannot be written; what stood at ``path`` before is untouched then.
    """
    draft = path.with_name(f".{secrets.token_hex(8)}{_DRAFT}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0), 0o666)
        try:
            with open(descriptor, "wb") as file:
                yield file
            os.replace(draft, path)
        except BaseException:
            with suppress(OSError):
                draft.unlink()
            raise
    except OSError as error:
        raise file_error(error, path) from None


def write_text(path: Path, text: str) -> None:
    """Write a text as UTF-8, whole or not at all; what UTF-8 cannot hold becomes a question mark.

    Raises `BsaError` if the file cannot be written.
    """
    with replacing(path) as file:
        file.write(text.encode("utf-8", errors="replace"))


def write_json(path: Path, content: Mapping[str, Any], indent: int | None = None) -> None:
    """Write a JSON object, whole or not at all. Raises `BsaError` if the file cannot be written."""
    write_text(path, json.dumps(content, indent=indent, ensure_ascii=False) + "\n")


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write flat rows under a header of their keys, whole or not at all; what is not a number is left empty.

    Raises `BsaError` if the file cannot be written.
    """
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]) if rows else [])
    writer.writeheader()
    # Only NaN differs from itself.
    writer.writerows({key: "" if value != value else value for key, value in row.items()} for row in rows)
    write_text(path, text.getvalue())


def read_json(path: Path) -> dict[str, Any] | None:
    """A JSON object; None where there is none, or half of one."""
    try:
        return json_object(path.read_bytes()) if path.is_file() else None
    except OSError:
        return None


def load_json(path: Path, hint: str) -> Any:
    """What a JSON file holds. Raises `BsaError` if it cannot be read or is none."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise file_error(error, path) from None
    except (ValueError, RecursionError) as error:
        raise BsaError(f"{path} is not valid JSON: {shown(error)}.", hint) from None


def file_digest(path: Path) -> str:
    """A hash of what a file holds. Raises `BsaError` if it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise file_error(error, path) from None


@contextmanager
def gone_if_empty(folders: Iterable[Path]) -> Iterator[None]:
    """Remove folders after the block, inner ones first, as far as there is nothing in them."""
    try:
        yield
    finally:
        for folder in folders:
            with suppress(OSError):  # there is something in it
                folder.rmdir()


def entries(folder: Path) -> set[str]:
    """Names in a folder, drafts of killed processes left out; none if there is no folder.

    Raises `BsaError` if it is not a folder, or cannot be read.
    """
    try:
        return {name for name in os.listdir(folder) if not name.endswith(_DRAFT)}
    except FileNotFoundError:
        if folder.is_symlink():
            raise BsaError(f"{folder} is a link to nothing.", "choose another folder.") from None
        return set()
    except OSError as error:
        raise file_error(error, folder) from None


def begins(path: Path, beginning: bytes) -> bool:
    """Whether the path is a plain file, no link, that begins like this, or was cut short while it began so.

    Raises `BsaError` if it cannot be read.
    """
    try:
        if path.is_symlink() or not path.is_file():
            return False
        with path.open("rb") as file:
            return beginning.startswith(file.read(len(beginning)))
    except OSError as error:
        raise file_error(error, path) from None


def foreign(path: Path, wanted: str) -> BsaError:
    """The refusal of a path that holds something else than ``wanted``, which would be overwritten."""
    return BsaError(f"{path} holds something that is not {wanted}; nothing was written.", "choose another path.")
