"""``bsa export``: the calibrated cell for other programs."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from ...core.printable import one_line
from . import shared_options as shared


def export(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a finished run.")],
    to: Annotated[
        Literal["bpx", "parameter-values"],
        shared.output_option(
            metavar="FORMAT", case_sensitive=False, help="bpx, or parameter-values (PyBaMM's own JSON)."
        ),
    ],
    out: Annotated[
        Path | None, shared.output_option(metavar="FILE", help="The file; by default in the run's folder.")
    ] = None,
) -> None:
    """Write the best parameters of a run as BPX or as PyBaMM's parameter values."""
    from ...core.files import foreign, write_text
    from ..export_cell import FILES, exported

    path = out or run / FILES[to]
    if path.exists() and not _is_exported(path):
        raise foreign(path, "an exported cell")
    text, remarks = exported(run, to)
    write_text(path, text)
    for remark in remarks:
        print(one_line(remark, 400))
    print(path)


def _is_exported(path: Path) -> bool:
    """Whether a file holds an earlier export, which may be written anew."""
    from ...core.files import read_json

    content = read_json(path) or {}
    header = content.get("Header")
    return (isinstance(header, dict) and "BPX" in header) or "Nominal cell capacity [A.h]" in content
