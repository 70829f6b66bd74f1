"""The server: tools with their descriptions, confined to folders, over standard input and output."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import anyio.to_thread
from mcp.server.mcpserver import Context, MCPServer
from mcp.server.mcpserver.exceptions import ToolError
from mcp.types import CallToolResult, InputRequiredResult
from pydantic import Field, ValidationError

from ...core.errors import BsaError, unknown
from ...core.printable import shown
from ...core.redaction import redact
from ...core.run.run_config import RunConfig
from ...core.validation import explain
from ..request import refuse_beside_task
from ..run_names import named_after, reserved_folder
from ..tasks.task_file import is_task_file
from . import functions
from .arguments import Arguments, Cell, Reading, is_name
from .folders import Folders
from .functions import simulations_of
from .work import Json, carried_out

INSTRUCTIONS = """\
Parameterises physics-based lithium-ion battery models (PyBaMM) against cycler records, and finds physical effects that
a model lacks. Look at a record first (read_record). Try values by hand (simulate, sensitivities), or have them fitted
(calibrate). A model that still does not fit may lack an effect (discover). Currents are positive on discharge in
results, and positive on charge in files. Paths are relative to the first folder of the server."""

Data = Annotated[
    str | list[str], Field(description='Path of a record, or several; or the name of a task, "demo" (without `cell`).')
]
Records = Annotated[str | list[str], Field(description="Path of a record, or several.")]
Values = Annotated[
    dict[str, float],
    Field(
        description="Values of searched parameters by name; the others keep their initial ones. Left out, all do, and "
        "`values` of the answer has their names."
    ),
]
Out = Annotated[str | None, Field(description="New folder for the run; by default one under runs/.")]
Resume = Annotated[str | None, Field(description="Go on with the stopped run in this folder; its options are its own.")]


class Tools:
    """The tools of one server, which may read and write what lies in its folders."""

    def __init__(self, folders: Folders) -> None:
        self._folders = folders

    async def read_record(self, path: str, reading: Reading = Reading()) -> Json:  # noqa: B008
        """Read a cycler's file: its steps with durations, currents and voltages, and what was assumed or repaired."""
        return await anyio.to_thread.run_sync(functions.read_record, self._folders.file(path), reading.model_dump())

    async def simulate(
        self,
        context: Context,
        data: Data,
        values: Values = {},  # noqa: B006  (read only)
        cell: Cell = Cell(),  # noqa: B008
        reading: Reading = Reading(),  # noqa: B008
    ) -> Json:
        """Simulate a record or task at given parameter values: errors, features by step and curves."""
        return await carried_out(context, functions.simulate, self._asked(data, values, cell, reading))

    async def sensitivities(
        self,
        context: Context,
        data: Data,
        values: Values = {},  # noqa: B006  (read only)
        cell: Cell = Cell(),  # noqa: B008
        reading: Reading = Reading(),  # noqa: B008
    ) -> Json:
        """Find what a small step of each searched parameter changes about the match, around given values."""
        return await carried_out(context, functions.sensitivities, self._asked(data, values, cell, reading))

    async def calibrate(
        self,
        context: Context,
        data: Data = "demo",
        cell: Cell = Cell(),  # noqa: B008
        reading: Reading = Reading(),  # noqa: B008
        simulations: Annotated[
            int | None,
            Field(ge=1, description="Simulations at most, in all; 100, or of a resumed run its own, if left out."),
        ] = None,
        scaffold: Annotated[
            str | None,
            Field(description="Method: staged (usual for measured currents), hybrid, least-squares, cma-es, bo, ..."),
        ] = None,
        seed: int = 1234,
        out: Out = None,
        resume: Resume = None,
    ) -> Json:
        """Fit the searched parameters to records or a task; gives values, intervals, errors and a report."""
        if scaffold is not None and not is_name(scaffold):
            raise BsaError(f"scaffold is {shown(repr(scaffold))}, which is no name.", "name one that is built in.")
        if resume is None:
            simulations = simulations or RunConfig.model_fields["simulations"].default
        method = {"scaffold": scaffold, "simulations": simulations, "seed": seed}
        return await self._run(context, functions.calibrate, data, cell, reading, method, out, resume, simulations)

    async def discover(
        self,
        context: Context,
        data: Records = "",
        cell: Cell = Cell(),  # noqa: B008
        reading: Reading = Reading(),  # noqa: B008
        effect: Annotated[
            list[str] | None, Field(description="Effects to consider, by name; all, if left out.")
        ] = None,
        life: Annotated[
            bool, Field(description="The record is a whole life: find which mechanism ages the cell.")
        ] = False,
        fit_cycles: Annotated[
            int | None, Field(ge=1, description="Of a life fit so many cycles; the later ones are held out.")
        ] = None,
        seed: int = 0,
        out: Out = None,
        resume: Resume = None,
    ) -> Json:
        """Find which physical effect the model lacks, if any: verdict, effects with intervals, errors and a report."""
        method = {"effect": effect, "life": life, "fit_cycles": fit_cycles, "seed": seed}
        # A list holds files alone: a discovery takes no task by name.
        files = [data] if isinstance(data, str) else data
        return await self._run(context, functions.discover, files, cell, reading, method, out, resume, None)

    async def report(self, folder: str) -> Json:
        """Read what came of an earlier calibration or discovery, from its folder."""
        return await anyio.to_thread.run_sync(functions.report, self._folders.inside(folder))

    async def _run(
        self,
        context: Context,
        function: Callable[..., Json],
        data: str | list[str],
        cell: Cell,
        reading: Reading,
        method: Mapping[str, Any],
        out: str | None,
        resume: str | None,
        simulations: int | None,
    ) -> Json:
        if resume is not None:
            folder = self._folders.inside(resume)
            self._check_resumed(folder)
            options: Json = {"resume": folder, **({} if simulations is None else {"simulations": simulations})}
            simulations = simulations or simulations_of(folder)
            return await carried_out(context, function, {"options": options}, folder, simulations)
        found = self._data(data, cell, reading)
        options = {"data": found, **cell.given(self._folders), **method}
        if not isinstance(found, str):
            options |= reading.model_dump()
        with self._new_folder(out, found) as folder:
            return await carried_out(context, function, {"options": {**options, "out": folder}}, folder, simulations)

    def _check_resumed(self, folder: Path) -> None:
        """Refuse what asks a language model, as the assistant is one, or reads files outside the folders.

        Others may have begun it.
        """
        config, paths = functions.begun_with(folder)
        asked = config.get("backend")
        if asked not in (None, "rules") or config.get("backend_options"):
            raise BsaError(
                f'{shown(folder.name)} asks the backend "{shown(asked)}", which this server does not.',
                "go on with it by bsa run --resume or bsa discover --resume.",
            )
        for path in paths:
            if not Path(path).is_absolute():
                raise BsaError(
                    f"{shown(folder.name)} reads {shown(path, 200)}, a path that begins where the server was started.",
                    "go on with it by bsa discover --resume, in the folder where it began.",
                )
            self._folders.file(path)

    def _new_folder(self, out: str | None, data: str | list[Path]) -> AbstractContextManager[Path]:
        """The folder of a new run; two calls at once are given two."""
        if out is not None:
            return nullcontext(self._folders.inside(out))
        return reserved_folder(self._folders.inside("runs"), data if isinstance(data, str) else named_after(data))

    def _asked(self, data: str | list[str], values: Mapping[str, float], cell: Cell, reading: Reading) -> Json:
        return {
            "data": self._data(data, cell, reading),
            "cell": cell.given(self._folders),
            "options": reading.model_dump(),
            "values": dict(values),
        }

    def _data(self, data: str | list[str], cell: Cell, reading: Reading) -> str | list[Path]:
        """Files inside the folders, or the name of a task, beside which no cell and no reading is given.

        A task file may name files elsewhere, and is not read.
        """
        names = [data] if isinstance(data, str) else data
        if not all(names) or not names:
            raise BsaError("data is missing.", "give the path of a record; a stopped run goes on with `resume` alone.")
        wrong = [name for name in names if is_task_file(name)]
        if wrong:
            raise BsaError(f"{shown(wrong[0], 200)} is a task file.", "give its records and the cell instead.")
        if isinstance(data, str) and is_name(data) and not (self._folders.first / data).exists():
            given = [name for said in (cell, reading) for name in said.model_dump(exclude_defaults=True)]
            refuse_beside_task(sorted(given), data)
            return data
        return [self._folders.file(name) for name in names]


class Server(MCPServer[Any]):
    """The SDK's server, whose errors an assistant reads: a `BsaError` with its hint, and wrong arguments as one."""

    async def call_tool(
        self, name: str, arguments: dict[str, Any], context: Context[Any, Any] | None = None
    ) -> CallToolResult | InputRequiredResult:
        """See the SDK; raises `ToolError`."""
        await self._check_names(name, arguments)
        try:
            return await super().call_tool(name, arguments, context)
        except ToolError as error:
            cause = error.__cause__
            if isinstance(cause, BsaError):
                raise ToolError(f"Error executing tool {name}: {redact(str(cause))}") from None
            if isinstance(cause, ValidationError):
                raise ToolError(redact(str(explain(cause, name, Arguments)))) from None
            raise

    async def _check_names(self, name: str, arguments: Mapping[str, Any]) -> None:
        """Whether the tool has these arguments; the SDK passes over those that it has not."""
        for tool in await self.list_tools():
            known = list(tool.input_schema.get("properties", {}))
            others = [key for key in arguments if tool.name == name and key not in known]
            if others:
                message = f"{name}: {shown(repr(others[0]))} is not an argument."
                error = unknown(message, others[0], known, "its arguments: {}.")
                raise ToolError(redact(str(error)))


def server(folders: Sequence[Path]) -> MCPServer[Any]:
    """A server whose tools are confined to these folders."""
    made = Server(
        "battery-sim-agent", instructions=INSTRUCTIONS, version=version("battery-sim-agent"), log_level="WARNING"
    )
    tools = Tools(Folders(folders))
    for tool in (tools.read_record, tools.simulate, tools.sensitivities, tools.calibrate, tools.discover, tools.report):
        made.add_tool(tool)
    return made
