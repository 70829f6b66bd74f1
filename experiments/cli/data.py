"""``bsa data``: what a laboratory's files hold, without any model."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...core.errors import BsaError
from ...core.files import begins, foreign
from ...core.printable import shown, strip_control
from ...core.reading.part_of_file import file_and_part
from . import shared_options as shared
from .option_groups import with_options

if TYPE_CHECKING:
    from ...core.record import Record
    from ...core.spectrum import ImpedanceSpectrum

_PICTURES = {".png": b"\x89PNG", ".svg": b"<?xml"}
_RECORDS = {".csv": b"Test Time / s,", ".parquet": b"PAR1"}
"""Endings of the files that are written, and how each of these begins."""


@with_options(shared.Reading)
def data(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Records, spectra, or folders of the files of one cell.")
    ],
    join: shared.Join = False,
    *,
    reading: shared.Reading,
    plot: Annotated[Path | None, shared.output_option(metavar="FILE", help="Draw the record (.png or .svg).")] = None,
    export: Annotated[
        str | None, shared.output_option(metavar="bdf", help="Write the record in the Battery Data Format, to --out.")
    ] = None,
    out: Annotated[
        Path | None, shared.output_option(metavar="FILE", help="Where --export writes (.csv or .parquet).")
    ] = None,
    as_json: Annotated[bool, shared.output_option("--json", help="Print everything as JSON.")] = False,
) -> None:
    """Say what files hold: signals, steps, cycles, resistances, slow curves and every problem."""
    from ..read_options import one_each

    _check_outputs(files, join, plot, export, out)
    sources: list[Any] = [files] if join else list(files)
    reads = one_each(reading.readings(join), len(sources))
    found = [read.read(source) for source, read in zip(sources, reads, strict=True)]
    parts = [_parts(one) for one in found]
    if plot is not None:
        from ..data.picture import draw
        from ..data.words import listed_share

        draw(found[0], plot, listed_share(found[0], parts[0]))
    if out is not None:
        _export(found[0], out)
    if as_json:
        contents = [content for one, some in zip(found, parts, strict=True) for content in _contents(one, some)]
        print(json.dumps(contents[0] if len(contents) == 1 else contents, indent=1))
        return
    blocks = [block for one, some in zip(found, parts, strict=True) for block in _blocks(one, some)]
    print(strip_control("\n\n".join(blocks)))
    for path in (plot, out):
        if path is not None:
            print(f"\nwritten: {path}")


def _check_outputs(files: list[Path], join: bool, plot: Path | None, export: str | None, out: Path | None) -> None:
    """Refuse what cannot be done before anything is read."""
    if export not in (None, "bdf"):
        raise BsaError(f'there is no export "{shown(export)}".', "write --export bdf --out FILE.csv (or .parquet).")
    if (export is None) != (out is None):
        raise BsaError("--export and --out belong together.", "write --export bdf --out FILE.csv (or .parquet).")
    if len(files) > 1 and not join and (plot is not None or out is not None):
        raise BsaError(
            f"{len(files)} files were given, and one picture or export asked for.",
            "give one file, or --join for the files of one cell.",
        )
    if plot is not None:
        _check_output("--plot", plot, _PICTURES, "a picture", files)
    if out is not None:
        _check_output("--out", out, _RECORDS, "a record in the Battery Data Format", files)


def _check_output(option: str, path: Path, beginnings: Mapping[str, bytes], kind: str, files: list[Path]) -> None:
    """Refuse to write what the name does not say, over a file that is read, or over something else than ``kind``."""
    beginning = beginnings.get(path.suffix.lower())
    if beginning is None:
        endings = " or ".join(beginnings)
        raise BsaError(f"{shown(path, 200)} is not the name of {kind}.", f"end it in {endings}.")
    for file, _ in map(file_and_part, files):
        if file.exists() and path.exists() and path.samefile(file):
            raise BsaError(
                f"{option} {shown(path, 200)} is a file that is read; nothing was written.", "choose another path."
            )
        if file.is_dir() and path.resolve().parent == file.resolve():
            raise BsaError(
                f"{option} {shown(path, 200)} lies in the folder {shown(file, 200)}, whose files are read; nothing was "
                "written.",
                "choose a path outside of it.",
            )
    if (path.exists() or path.is_symlink()) and not begins(path, beginning):
        raise foreign(path, kind)


def _parts(found: Record | ImpedanceSpectrum) -> Sequence[Record]:
    """What a calibration would use of a record: it is cut where the charge is not known."""
    from ...core.reading.parts import parts_between_gaps
    from ...core.record import Record

    return parts_between_gaps(found) if isinstance(found, Record) else []


def _export(found: Record | ImpedanceSpectrum, out: Path) -> None:
    from ...core.record import Record
    from ...plugins.readers.bdf import write

    if not isinstance(found, Record):
        raise BsaError(
            f"{found.name} is an impedance spectrum; the Battery Data Format holds records over time.",
            "leave out --export.",
        )
    write(found, out)


def _contents(whole: Record | ImpedanceSpectrum, parts: Sequence[Record]) -> Iterator[dict[str, Any]]:
    """What is printed of one file as JSON, a part each."""
    from ...core.reading.summary import summary
    from ...core.record import Record
    from ..data.signs import positive_on_charge
    from ..data.words import size_of

    if not isinstance(whole, Record):
        yield _spectrum_content(whole)
        return
    signed = {"kind": "record", "sign": "current is positive on charge", "whole": size_of(whole)}
    for part in parts:
        yield signed | asdict(positive_on_charge(summary(part)))


def _spectrum_content(found: ImpedanceSpectrum) -> dict[str, Any]:
    from scipy.constants import zero_Celsius

    return {
        "kind": "impedance spectrum",
        "name": found.name,
        "frequency_hz": found.frequency.tolist(),
        "real_ohm": found.impedance.real.tolist(),
        "imaginary_ohm": found.impedance.imag.tolist(),
        "ohmic_ohm": found.ohmic_resistance,
        "voltage": found.voltage,
        "temperature_c": None if found.temperature_k is None else found.temperature_k - zero_Celsius,
        "problems": found.notes,
    }


def _blocks(whole: Record | ImpedanceSpectrum, parts: Sequence[Record]) -> Iterator[str]:
    """What is printed of one file: how much of it is listed, if not all, and its parts."""
    from ...core.reading.summary import summary
    from ...core.record import Record
    from ..data.words import listed_share, record_lines, spectrum_lines, wrapped

    if not isinstance(whole, Record):
        yield "\n".join(spectrum_lines(whole))
        return
    if share := listed_share(whole, parts):
        yield "\n".join(wrapped(f"{whole.name}: {share}; a picture and an export hold all of it."))
    for part in parts:
        yield "\n".join(record_lines(summary(part)))
