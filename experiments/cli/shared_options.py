"""Options that several commands take: how a record is read, and which language model answers."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import completion

if TYPE_CHECKING:
    from ...core.record import ReadOptions

# Options stand in these groups on the help page, in this order.
RECORDS, MODEL, SEARCH, LANGUAGE_MODEL, OUTPUT = "Records", "Model", "Search", "Language model", "Output"

Model = Annotated[str, typer.Option(metavar="NAME", help="SPM, SPMe or DFN.", rich_help_panel=MODEL)]
ModelOptions = Annotated[
    list[str] | None,
    typer.Option("--options", metavar="KEY=VALUE", help="PyBaMM model option; repeat.", rich_help_panel=MODEL),
]

Holdout = Annotated[
    list[Path] | None,
    typer.Option(
        "--holdout", metavar="FILE...", help="Records that are predicted, never fitted.", rich_help_panel=RECORDS
    ),
]
InitialSocs = Annotated[
    list[float] | None,
    typer.Option(
        "--initial-soc",
        metavar="SOC",
        help="State of charge at which a record starts, 0 to 1, where its first voltage does not tell; one for all "
        "records, or repeat in their order.",
        rich_help_panel=RECORDS,
    ),
]
Join = Annotated[
    bool,
    typer.Option(
        "--join", help="The files are of one cell: join them in the order of their dates.", rich_help_panel=RECORDS
    ),
]
Scale = Annotated[
    bool,
    typer.Option(
        "--scale/--no-scale", help="Scale the electrode area to the records' capacity.", rich_help_panel=MODEL
    ),
]

Via = Annotated[
    str | None,
    typer.Option(
        metavar="ROUTE",
        help="Route to a preset's model: litellm, openai, ollama, transformers or a plugin's.",
        autocompletion=completion.routes,
        rich_help_panel=LANGUAGE_MODEL,
    ),
]
BaseUrl = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="OpenAI-compatible or Ollama server, http://127.0.0.1:8000/v1.",
        rich_help_panel=LANGUAGE_MODEL,
    ),
]
BackendOption = Annotated[
    list[str] | None,
    typer.Option(
        "--backend-option",
        metavar="KEY=VALUE",
        help="Option of the backend; repeat.",
        rich_help_panel=LANGUAGE_MODEL,
    ),
]
MaxTokens = Annotated[
    int | None,
    typer.Option(min=0, metavar="N", help="Stop, resumably, after this many tokens.", rich_help_panel=LANGUAGE_MODEL),
]
MaxCost = Annotated[
    float | None,
    typer.Option(min=0, metavar="USD", help="Stop, resumably, after this much money.", rich_help_panel=LANGUAGE_MODEL),
]
Seed = Annotated[int, typer.Option(min=0, metavar="N", help="Seed for everything random.", rich_help_panel=SEARCH)]
Workers = Annotated[int, typer.Option(min=1, metavar="N", help="Runs side by side.", rich_help_panel=SEARCH)]

SimulationWorkers = Annotated[
    int,
    typer.Option(
        "--workers",
        min=0,
        metavar="N",
        help="Simulations side by side; 0: as many as cores, 4 at most.",
        rich_help_panel=SEARCH,
    ),
]
Resume = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="Go on with the interrupted run in this folder.", rich_help_panel=OUTPUT),
]


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(version("battery-sim-agent"))
        raise typer.Exit


Version = Annotated[
    bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and stop.")
]


@dataclass(frozen=True)
class Reading:
    """How records are read, where they do not say it themselves."""

    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=NAME", help="Column of a signal, voltage='Ecell/V'; repeat.", rich_help_panel=RECORDS
        ),
    ] = None
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=UNIT", help="Unit of a signal, current=mA; repeat.", rich_help_panel=RECORDS),
    ] = None
    where: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUE", help="Keep only rows with this value, test_id=1; repeat.", rich_help_panel=RECORDS
        ),
    ] = None
    current_sign: Annotated[
        str,
        typer.Option(
            metavar="SIGN",
            help="charge-positive (as cyclers write), discharge-positive or auto.",
            autocompletion=completion.current_signs,
            rich_help_panel=RECORDS,
        ),
    ] = "charge-positive"
    constant_current: Annotated[
        float | None,
        typer.Option(
            metavar="A",
            help="Current of a file without a current column, signed as --current-sign.",
            rich_help_panel=RECORDS,
        ),
    ] = None
    cycles: Annotated[
        str | None,
        typer.Option(metavar="N-M", help='Cycles of the records to use, "1" or "2-4".', rich_help_panel=RECORDS),
    ] = None
    sheet: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Sheet of a workbook, or test inside a file.", rich_help_panel=RECORDS),
    ] = None
    reader: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Reader to use; left out, the one that fits.",
            autocompletion=completion.readers,
            rich_help_panel=RECORDS,
        ),
    ] = None
    reader_option: Annotated[
        list[str] | None,
        typer.Option(
            "--reader-option", metavar="KEY=VALUE", help="Option of the reader; repeat.", rich_help_panel=RECORDS
        ),
    ] = None
    temperature: Annotated[
        float | None,
        typer.Option(metavar="DEGC", help="Ambient temperature where records lack it.", rich_help_panel=RECORDS),
    ] = None

    def options(self, join: bool = False) -> ReadOptions:
        """What a header does not say, and whether the files are of one cell."""
        from ..request import key_texts, read_options

        return read_options(
            columns=key_texts(self.column, "--column"),
            units=key_texts(self.unit, "--unit"),
            where=key_texts(self.where, "--where"),
            cycles=self.cycles,
            current_sign=self.current_sign,
            constant_current_a=self.constant_current,
            sheet=self.sheet,
            ambient_c=self.temperature,
            join=join,
        )

    @property
    def reader_options(self) -> dict[str, Any]:
        """The reader's own options."""
        from ..request import key_values

        return key_values(self.reader_option, "--reader-option")

    @property
    def typed(self) -> dict[str, Any]:
        """What was set, by the option's name."""
        values = {
            f"--{field.name.replace('_', '-')}": (getattr(self, field.name), field.default) for field in fields(self)
        }
        return {name: value for name, (value, unset) in values.items() if value != unset}


def reaching(via: str | None, base_url: str | None, backend_option: list[str] | None, **more: Any) -> dict[str, Any]:
    """What the command line says about the language model, as it goes into a configuration: only what was set."""
    from ..request import backend_options, key_values

    return backend_options(key_values(backend_option, "--backend-option"), via=via, base_url=base_url, **more)


@dataclass(frozen=True)
class LanguageModel:
    """Which language model is asked, and how it is reached."""

    backend: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="A preset, litellm:PROVIDER/MODEL, ... as bsa run takes it.",
            autocompletion=completion.backends,
            rich_help_panel=LANGUAGE_MODEL,
        ),
    ] = None
    via: Via = None
    base_url: BaseUrl = None
    backend_option: BackendOption = None

    @property
    def options(self) -> dict[str, Any]:
        """As a configuration holds them."""
        return reaching(self.via, self.base_url, self.backend_option)
