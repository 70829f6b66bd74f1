"""Options that several commands take: how a record is read, and which language model answers."""

from __future__ import annotations

import sys
from collections.abc import Collection
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import completion
from .usage_errors import option_or_argument

if TYPE_CHECKING:
    from ..campaign.grid_file import BackendChoice
    from ..file_reading import FileReading

# Options stand in these groups on the help page, in this order.
records_option = partial(typer.Option, rich_help_panel="Records")
model_option = partial(typer.Option, rich_help_panel="Model")
search_option = partial(typer.Option, rich_help_panel="Search")
language_model_option = partial(typer.Option, rich_help_panel="Language model")
output_option = partial(typer.Option, rich_help_panel="Output")

Model = Annotated[str, model_option(metavar="NAME", help="SPM, SPMe or DFN.")]
ModelOptions = Annotated[
    list[str] | None, model_option("--options", metavar="KEY=VALUE", help="PyBaMM model option; repeat.")
]

RecordsFolder = Annotated[
    Path, records_option("--data", metavar="FOLDER", help="Where the records are (they are not shipped).")
]
Holdout = Annotated[
    list[Path] | None, records_option("--holdout", metavar="FILE...", help="Records that are predicted, never fitted.")
]
Reference = Annotated[
    list[Path] | None,
    records_option(
        "--reference",
        metavar="FILE...",
        help="Earlier records of the same tests on the same cell, in the order of --data and --holdout, once or "
        "several times: only what has changed since is to be explained.",
    ),
]
InitialSocs = Annotated[
    list[float] | None,
    records_option(
        "--initial-soc",
        metavar="SOC",
        help="State of charge at which a record starts, 0 to 1, where its first voltage does not tell; one for all "
        "records, or repeat in their order.",
    ),
]
Join = Annotated[
    bool, records_option("--join", help="The files are of one cell: join them in the order of their dates.")
]
Ocp = Annotated[
    str,
    model_option(
        "--ocp",
        metavar="WHOSE",
        help="Whose open-circuit potentials to start from: nearest (of the installed sets, to the slowest record), a "
        "set, or NEGATIVE/POSITIVE; default: those of --parameters.",
    ),
]
Scale = Annotated[bool, model_option("--scale/--no-scale", help="Scale the electrode area to the records' capacity.")]
Life = Annotated[
    bool,
    model_option(
        "--life", help="The records are whole lives: compare capacity by cycle, and the curves of a few cycles."
    ),
]
FitCycles = Annotated[
    int | None,
    model_option("--fit-cycles", min=1, metavar="N", help="Of a life fit the first N cycles; later ones are held out."),
]

MaxTokens = Annotated[
    int | None, language_model_option(min=0, metavar="N", help="Stop, resumably, after this many tokens.")
]
MaxCost = Annotated[
    float | None, language_model_option(min=0, metavar="USD", help="Stop, resumably, after this much money.")
]
Seed = Annotated[int, search_option(min=0, metavar="N", help="Seed for everything random.")]

SimulationWorkers = Annotated[
    int,
    search_option("--workers", min=0, metavar="N", help="Simulations side by side; 0: as many as cores, 4 at most."),
]
Resume = Annotated[Path | None, output_option(metavar="FOLDER", help="Go on with the run in this folder.")]


def note_what_resuming_leaves(context: typer.Context, taken: Collection[str]) -> None:
    """Say which of the typed options a run that is gone on with does not take; those of these names it takes."""
    left = [
        name if name.startswith("-") else f"the argument {name}"
        for parameter in context.command.params
        for name in [option_or_argument(parameter)]
        if parameter.name not in ("resume", *taken)
        and getattr(context.get_parameter_source(str(parameter.name)), "name", "") == "COMMANDLINE"
    ]
    if left:
        verb = "is" if len(left) == 1 else "are"
        print(f"note: a resumed run goes on as it was begun; {', '.join(left)} {verb} not taken.", file=sys.stderr)


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
        list[str] | None, records_option(metavar="KEY=NAME", help="Column of a signal, voltage='Ecell/V'; repeat.")
    ] = None
    unit: Annotated[
        list[str] | None, records_option(metavar="KEY=UNIT", help="Unit of a signal, current=mA; repeat.")
    ] = None
    where: Annotated[
        list[str] | None, records_option(metavar="KEY=VALUE", help="Keep only rows with this value, test_id=1; repeat.")
    ] = None
    current_sign: Annotated[
        str,
        records_option(
            metavar="SIGN",
            help="charge-positive (as cyclers write), discharge-positive or auto.",
            autocompletion=completion.current_signs,
        ),
    ] = "charge-positive"
    constant_current: Annotated[
        list[float] | None,
        records_option(
            metavar="A",
            help="Current of a file without a current column, signed as --current-sign; one for all files, or repeat "
            "in their order, held-out ones last.",
        ),
    ] = None
    current_offset: Annotated[
        list[float] | None,
        records_option(
            metavar="A",
            help="What the instrument adds to every current that is not zero, positive on charge (0 keeps the current "
            "of a record that does not bring its charge back); repeat likewise.",
        ),
    ] = None
    voltage_lag: Annotated[
        list[float] | None,
        records_option(
            metavar="S",
            help="How much later than the current the instrument writes the voltage; left out, what the record shows "
            "(bsa discover: none); repeat likewise.",
        ),
    ] = None
    cycles: Annotated[str | None, records_option(metavar="N-M", help='Cycles of the records to use, "1" or "2-4".')] = (
        None
    )
    sheet: Annotated[str | None, records_option(metavar="NAME", help="Sheet of a workbook, or test inside a file.")] = (
        None
    )
    reader: Annotated[
        str | None,
        records_option(
            metavar="NAME", help="Reader to use; left out, the one that fits.", autocompletion=completion.readers
        ),
    ] = None
    reader_option: Annotated[
        list[str] | None, records_option("--reader-option", metavar="KEY=VALUE", help="Option of the reader; repeat.")
    ] = None
    temperature: Annotated[
        list[float] | None,
        records_option(metavar="DEGC", help="Ambient temperature, in place of what the records say; repeat likewise."),
    ] = None

    def readings(self, join: bool = False) -> list[FileReading]:
        """How files are read, and whether they are of one cell: once for all files, or for each.

        Raises `BsaError` if an option is not valid, or two are repeated different numbers of times.
        """
        from ..read_options import readings
        from ..run_settings import key_texts, key_values

        return readings(
            key_texts(self.column, "--column"),
            key_texts(self.unit, "--unit"),
            self.current_sign,
            self.constant_current,
            self.current_offset,
            self.voltage_lag,
            key_texts(self.where, "--where"),
            self.cycles,
            self.sheet,
            self.reader,
            key_values(self.reader_option, "--reader-option"),
            self.temperature,
            join,
        )

    @property
    def typed(self) -> dict[str, Any]:
        """What was set, by the option's name."""
        values = {
            f"--{field.name.replace('_', '-')}": (getattr(self, field.name), field.default) for field in fields(self)
        }
        return {name: value for name, (value, unset) in values.items() if value != unset}


@dataclass(frozen=True)
class LanguageModel:
    """Which language model is asked, and how it is reached."""

    backend: Annotated[
        str | None,
        language_model_option(
            metavar="NAME",
            help="A preset, litellm:PROVIDER/MODEL, ...",
            autocompletion=completion.backends,
        ),
    ] = None
    via: Annotated[
        str | None,
        language_model_option(
            metavar="ROUTE",
            help="Route to a preset's model: litellm, openai, ollama, transformers or a plugin's.",
            autocompletion=completion.routes,
        ),
    ] = None
    base_url: Annotated[
        str | None,
        language_model_option(metavar="URL", help="OpenAI-compatible or Ollama server, http://127.0.0.1:8000/v1."),
    ] = None
    backend_option: Annotated[
        list[str] | None,
        language_model_option("--backend-option", metavar="KEY=VALUE", help="Option of the backend; repeat."),
    ] = None

    @property
    def choice(self) -> BackendChoice:
        """The language model of a grid's methods that ask one."""
        from ..campaign.grid_file import BackendChoice

        return BackendChoice(use=self.backend or "rules", options=self.options())

    def options(self, **more: Any) -> dict[str, Any]:
        """How it is reached and asked, as it goes into a configuration: only what was set, ``more`` included."""
        from ..run_settings import backend_options, key_values

        own = key_values(self.backend_option, "--backend-option")
        return backend_options(own, via=self.via, base_url=self.base_url, **more)
