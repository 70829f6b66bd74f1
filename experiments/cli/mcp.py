"""``bsa mcp``: the functions of this package as tools of an assistant."""

from pathlib import Path
from typing import Annotated

import typer


def mcp(
    folder: Annotated[
        list[Path],
        typer.Option(
            "--folder", metavar="DIR", help="Folder that the tools may read and write; repeat. Runs go into the first."
        ),
    ],
) -> None:
    """Serve an assistant that speaks the Model Context Protocol, over standard input and output."""
    from ...core.extras import require

    require("mcp.server.mcpserver", "mcp", "bsa mcp")
    from ..mcp_server.server import server

    server(folder).run("stdio")
