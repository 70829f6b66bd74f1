"""Makes a folder of blind cases, with the answers in a sealed file."""

import base64
import json
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pybamm

from ...core.errors import BsaError
from ...core.files import begins, entries, foreign, write_text

Make = Callable[[Path, int, int, int], dict[str, Any]]
"""Writes a case into a folder and gives its answer, from the seed of a set, the case's number, and which attempt it
is."""

SEALED = "answers.sealed"

_BEGINNING = b"eJ"
"""How every sealed file begins: the head of compressed data in base64."""

DESCRIPTION = "case.json"

POINTS = 300
"""Averages of a record that a discovery on a case fits."""

_DRAWS = 6
"""Draws of a case before it is given up."""


def make_cases(
    folder: Path,
    make: Make,
    count: int,
    seed: int = 2026,
    listener: Callable[[str], None] = lambda text: None,
) -> list[Path]:
    """Make the first ``count`` cases of a seed and seal the answers; cases that are there already are kept.

    Each case is a folder with its records and ``case.json`` (parameter set, model, ambient temperatures), which say
    nothing of what is hidden. Where a case cannot be made another one is drawn. Raises `BsaError` if the folder holds
    other things, or cases of another seed.
    """
    found = begins(folder / SEALED, _BEGINNING)
    if entries(folder) and not found:
        raise foreign(folder, "a folder of blind cases")
    answers = _known(folder, seed) if found else {}
    _seal(folder, seed, answers)  # marks the folder as ours before the first case, which may take minutes
    made = []
    for number in range(count):
        name = f"case_{number + 1:03d}"
        if name in answers:
            continue
        answers[name] = _first_that_runs(folder / name, seed, number, listener, make)
        _seal(folder, seed, answers)
        made.append(folder / name)
        listener(f"{name} made")
    return made


def _known(folder: Path, seed: int) -> dict[str, Any]:
    content = _opened(folder)
    if content.get("seed") != seed and content.get("answers"):
        raise BsaError(
            f"{folder} holds cases of seed {content.get('seed')}, not {seed}.", "give that seed, or another folder."
        )
    return dict(content.get("answers", {}))


def _seal(folder: Path, seed: int, answers: dict[str, Any]) -> None:
    text = json.dumps({"seed": seed, "answers": answers})
    write_text(folder / SEALED, base64.b64encode(zlib.compress(text.encode())).decode())


def _first_that_runs(
    folder: Path, seed: int, number: int, listener: Callable[[str], None], make: Make
) -> dict[str, Any]:
    for attempt in range(_DRAWS):
        try:
            return make(folder, seed, number, attempt)
        except (pybamm.SolverError, BsaError, ValueError, IndexError) as error:
            if isinstance(error.__context__, OSError):  # a full disk: the seed's case is still this one
                raise
            listener(f"{folder.name}: draw {attempt + 1} failed ({type(error).__name__})")
    raise BsaError(f"{folder.name} could not be made in {_DRAWS} draws.", "another --seed may do, in another folder.")


def unseal(folder: Path) -> dict[str, Any]:
    """The answers by case; read when scoring and at no other time."""
    answers = _opened(folder).get("answers")
    if not isinstance(answers, dict):
        raise BsaError(
            f"{folder / SEALED} is of an earlier version, whose cases were no random draws.",
            "make the cases anew: bsa bench discovery make.",
        )
    return answers


def _opened(folder: Path) -> dict[str, Any]:
    path = folder / SEALED
    try:
        content: dict[str, Any] = json.loads(zlib.decompress(base64.b64decode(path.read_bytes())))
    except (OSError, ValueError, zlib.error) as error:
        raise BsaError(f"{path} cannot be read ({error}).", "give a folder of bsa bench discovery make.") from None
    return content
