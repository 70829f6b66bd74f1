"""``bsa new-plugin``: the package of a plugin of one's own."""

from pathlib import Path
from typing import Annotated

import typer

from ...core.contracts.kinds import KINDS
from ...core.printable import one_line
from . import completion


def new_plugin(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            help=f"{', '.join(KINDS[:-1])} or {KINDS[-1]}.",
            autocompletion=completion.kinds,
        ),
    ],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the plugin, my-plugin.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Where the package goes; bsa-NAME by default.")
    ] = None,
) -> None:
    """Write a package with a plugin that works and a test that passes, to be changed."""
    from ..new_plugin.package import write_package

    for path in write_package(kind, name, out):
        print(f"  {one_line(str(path), 400)}")
    folder = one_line(str(out or f"bsa-{name}"), 400)
    print(f'\nNext: pip install -e "{folder}[test]" && pytest {folder}')
