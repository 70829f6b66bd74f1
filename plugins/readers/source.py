"""The names and bytes of a file from outside the program."""

import gzip
import logging
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, cast

from ...core.errors import BsaError
from ...core.files import file_error
from ...core.printable import shown

MAX_BYTES = 512 * 2**20
"""Largest file that is read, decompressed."""

MAX_SAMPLES = 5_000_000
"""Largest number of rows that is read."""

_HEAD_BYTES = 65536

_TEXT_TABLES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".bdf", ".mpt", ".dta")

_CHINESE = ("电压", "电流")
"""Voltage and current: text that is not UTF-8 and holds either in GB 18030 is Chinese."""

_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
"""How text in UTF-16 begins."""

_ZIP = b"PK\x03\x04"
"""Beginning of a zip archive, whose table of contents is at its end."""

MAX_RATIO = 300
"""A part of a zip archive that grows by more than this when unpacked is refused (from `RATIO_BYTES` on)."""

RATIO_BYTES = 64 * 2**20


@contextmanager
def decoding(source: str, kind: str, hint: str) -> Iterator[None]:
    """Say in one line that a file is damaged, whatever it provokes in the library that decodes it.

    ``kind`` is what it should be: ``"MATLAB file"``.
    """
    try:
        yield
    except (BsaError, MemoryError):
        raise
    except OSError as error:
        if error.errno is not None:
            raise file_error(error) from None
        raise _damaged(source, kind, hint, error) from None
    except Exception as error:
        raise _damaged(source, kind, hint, error) from None


def silence(library: str) -> None:
    """Keep a library from logging what its errors say too, or what is of no matter to the user."""
    logging.getLogger(library).setLevel(logging.CRITICAL + 1)


def _damaged(source: str, kind: str, hint: str, error: Exception) -> BsaError:
    said = shown(error, 100)
    return BsaError(f"{source} is no {kind}, or a damaged one ({type(error).__name__}{': ' * bool(said)}{said}).", hint)


def refuse_large(size: int, source: str, hint: str) -> None:
    """Raise `BsaError` for a file of more than `MAX_BYTES` bytes."""
    if size > MAX_BYTES:
        raise BsaError(f"{source} holds more than {MAX_BYTES // 2**20} MiB.", hint)


def refuse_zip_bomb(path: Path, source: str, kind: str, most: int) -> None:
    """Look at the sizes that the parts of a zip archive declare, which is all that is unpacked of them.

    Raises `BsaError` if it is no zip archive, or unpacks to more than ``most`` bytes or `MAX_RATIO` times its size.
    """
    try:
        with zipfile.ZipFile(path) as package:
            parts = package.infolist()
    except OSError as error:
        raise file_error(error, shown(path)) from None
    except (zipfile.BadZipFile, ValueError, NotImplementedError):
        if head(path).startswith(_ZIP):
            raise BsaError(
                f"{source} begins like {kind} but is damaged or incomplete.", "copy, download or export it again."
            ) from None
        raise BsaError(
            f"{source} is not {kind}.", f"save or export it as {path.suffix} again, or give a CSV file its own name."
        ) from None
    unpacked = sum(part.file_size for part in parts)
    if unpacked > most:
        raise BsaError(
            f"{source} unpacks to {unpacked / 2**30:.1f} GiB, more than the limit of {most // 2**30} GiB.",
            "export the record as CSV.",
        )
    for part in parts:
        if part.file_size > RATIO_BYTES and part.file_size > MAX_RATIO * max(part.compress_size, 1):
            raise BsaError(
                f'{source}: the part "{shown(part.filename)}" unpacks to '
                f"{part.file_size // max(part.compress_size, 1)} times its size; the limit is {MAX_RATIO}.",
                "export the record as CSV.",
            )


def head(path: Path) -> bytes:
    """The first bytes, decompressed; nothing if the file cannot be read."""
    try:
        with _opened(path) as file:
            return file.read(_HEAD_BYTES)
    except (OSError, EOFError, zlib.error):
        return b""


def is_text_table(path: Path) -> bool:
    """Whether the name, without ``.gz``, ends like that of a text table."""
    plain = Path(path.stem) if path.suffix.lower() == ".gz" else path
    return plain.suffix.lower() in _TEXT_TABLES and path.is_file()


def first_lines(path: Path, count: int) -> list[str]:
    """The first lines of a text file, for a reader's ``matches``; none of a binary one."""
    data = head(path)
    text = data.decode("utf-16" if data.startswith(_UTF_16) else "utf-8-sig", errors="replace")
    return [] if "\0" in text else text.splitlines()[:count]


def load_text(path: Path) -> tuple[str, list[str]]:
    """The whole file as text, with notes on how it was decoded.

    Raises `BsaError` if the file cannot be read, is empty, is larger than `MAX_BYTES` or is not text.
    """
    name = shown(path.name)
    try:
        with _opened(path) as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise BsaError(f"there is no file {shown(path)}.", "check the path.") from None
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise BsaError(f"{name} is a damaged gzip file ({shown(error)}).", "download or compress it again.") from None
    except OSError as error:
        raise file_error(error, shown(path)) from None
    refuse_large(len(data), name, "cut it into smaller files, or thin it out first.")
    if not data.strip():
        raise BsaError(f"{name} is empty.", "export the record again.")
    return _decoded(data, name)


def _decoded(data: bytes, name: str) -> tuple[str, list[str]]:
    if data.startswith(_UTF_16):
        try:
            return data.decode("utf-16"), [f"{name} was read as UTF-16."]
        except UnicodeDecodeError:
            raise BsaError(f"{name} is damaged UTF-16 text.", "save it as UTF-8.") from None
    if b"\0" in data:
        where = data.index(b"\0")
        raise BsaError(
            f"{name} is not text (a zero byte at offset {where}).",
            "export the record as CSV from the cycler's software.",
        )
    try:
        return data.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        chinese = any(word.encode("gb18030") in data for word in _CHINESE)
        encoding, title = ("gb18030", "GB 18030") if chinese else ("cp1252", "Windows-1252")
        return data.decode(encoding, errors="replace"), [f"{name} is not UTF-8; it was read as {title}."]


def _opened(path: Path) -> IO[bytes]:
    if path.suffix.lower() == ".gz":
        return cast(IO[bytes], gzip.open(path, "rb"))
    return open(path, "rb")
