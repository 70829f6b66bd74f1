"""Options that several commands take: how a record is read, and which language model answers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from ...core.record import ReadOptions

ModelOptions = Annotated[list[str] | None, typer.Option("--options", help="PyBaMM model option key=value; repeat.")]

Column = Annotated[list[str] | None, typer.Option(help="Column of a signal, voltage='Ecell/V'; repeat.")]
Unit = Annotated[list[str] | None, typer.Option(help="Unit of a signal, current=mA; repeat.")]
Where = Annotated[list[str] | None, typer.Option(help="Keep only rows with this value, test_id=1; repeat.")]
CurrentSign = Annotated[str, typer.Option(help="charge-positive (as cyclers write), discharge-positive or auto.")]
ConstantCurrent = Annotated[
    float | None, typer.Option(help="Current in A of a file without a current column, signed as --current-sign.")
]
Cycles = Annotated[str | None, typer.Option(help='Cycles of the records to use, "1" or "2-4".')]
Sheet = Annotated[str | None, typer.Option(help="Sheet of a workbook, or test inside a file of several.")]
Reader = Annotated[str | None, typer.Option(help="Reader to use; left out, the one that fits.")]
ReaderOption = Annotated[
    list[str] | None, typer.Option("--reader-option", help="Option of the reader, key=value; repeat.")
]
Temperature = Annotated[float | None, typer.Option(help="Ambient temperature in degC, where records lack it.")]
Scale = Annotated[bool, typer.Option(help="Scale the electrode area to the records' capacity.")]

Via = Annotated[str | None, typer.Option(help="Route to the model: litellm, openai, ollama, transformers.")]
BaseUrl = Annotated[
    str | None, typer.Option(help="Address of an OpenAI-compatible or Ollama server, http://127.0.0.1:8000/v1.")
]
BackendOption = Annotated[
    list[str] | None, typer.Option("--backend-option", help="Option of the backend, key=value; repeat.")
]


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(version("battery-sim-agent"))
        raise typer.Exit


Version = Annotated[
    bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and stop.")
]


def reading(
    column: list[str] | None,
    unit: list[str] | None,
    where: list[str] | None,
    current_sign: str,
    constant_current: float | None,
    cycles: str | None,
    sheet: str | None,
    temperature: float | None,
) -> ReadOptions:
    """What the command line says about the records."""
    from ..request import key_texts, read_options

    return read_options(
        columns=key_texts(column, "--column"),
        units=key_texts(unit, "--unit"),
        where=key_texts(where, "--where"),
        cycles=cycles,
        current_sign=current_sign,
        constant_current_a=constant_current,
        sheet=sheet,
        ambient_c=temperature,
    )


def reaching(via: str | None, base_url: str | None, backend_option: list[str] | None, **more: Any) -> dict[str, Any]:
    """What the command line says about the language model, as it goes into a configuration: only what was set."""
    from ..request import key_values

    given = {"via": via, "base_url": base_url, **more}
    said = {key: str(value) if isinstance(value, Path) else value for key, value in given.items() if value is not None}
    return key_values(backend_option, "--backend-option") | said
