"""``bsa discover``: find where a model and records disagree, and name the missing effect."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError

from .progress import printable


def discover(
    data: Annotated[list[Path], typer.Option("--data", help="A record to explain; repeat for several.")],
    parameters: Annotated[str, typer.Option(help="PyBaMM parameter set to start from.")],
    out: Annotated[Path, typer.Option(help="Folder for discovery.json, report.html and augmented_model.py.")],
    holdout: Annotated[
        list[Path] | None, typer.Option(help="A record that is predicted, never fitted; repeat.")
    ] = None,
    model: Annotated[str, typer.Option(help="SPM, SPMe or DFN.")] = "DFN",
    options: Annotated[list[str] | None, typer.Option(help="PyBaMM model option key=value; repeat.")] = None,
    override: Annotated[list[str] | None, typer.Option(help="A parameter known better, 'name=value'; repeat.")] = None,
    column: Annotated[list[str] | None, typer.Option(help="Column of a signal, voltage='Ecell/V'; repeat.")] = None,
    unit: Annotated[list[str] | None, typer.Option(help="Unit of a signal, current=mA; repeat.")] = None,
    where: Annotated[list[str] | None, typer.Option(help="Keep only rows with this value, test_id=1; repeat.")] = None,
    current_sign: Annotated[str, typer.Option(help="charge-positive, discharge-positive or auto.")] = "charge-positive",
    constant_current: Annotated[float | None, typer.Option(help="Current in A of a file without a current.")] = None,
    cycles: Annotated[str | None, typer.Option(help='Cycles of the records to use, "1" or "2-4".')] = None,
    sheet: Annotated[str | None, typer.Option(help="Sheet of a workbook, or test inside a file of several.")] = None,
    reader: Annotated[str | None, typer.Option(help="Reader to use; left out, the one that fits.")] = None,
    temperature: Annotated[
        float | None, typer.Option(help="Ambient temperature in degC, where records lack it.")
    ] = None,
    scale: Annotated[bool, typer.Option(help="Scale the electrode area to the records' capacity.")] = True,
    search: Annotated[
        str,
        typer.Option(
            help="What is uncertain about the base model: all, capacity, particles, measured, or a YAML file."
        ),
    ] = "all",
    effect: Annotated[list[str] | None, typer.Option(help="Effect to consider; repeat; left out, all.")] = None,
    backend: Annotated[str | None, typer.Option(help="Language model that ranks effects too.")] = None,
    max_effects: Annotated[int, typer.Option(min=1, max=3, help="Effects in one explanation at most.")] = 2,
    seed: Annotated[int, typer.Option(min=0, help="Seed for everything random.")] = 0,
) -> None:
    """Find where a model and measured records disagree, name the missing effect, add it, show the gap shrink."""
    from ...core.validation import explain
    from ..discover import discover as find
    from ..discovery_case import DiscoverOptions
    from ..request import key_values, read_options

    read = read_options(
        columns=key_values(column, "--column"),
        units=key_values(unit, "--unit"),
        where=key_values(where, "--where"),
        cycles=cycles,
        current_sign=current_sign,
        constant_current_a=constant_current,
        sheet=sheet,
        ambient_c=temperature,
    )

    def files(paths: list[Path] | None) -> list[dict[str, Any]]:
        return [{"path": path, "read": read, "reader": reader} for path in paths or ()]

    try:
        asked = DiscoverOptions.model_validate(
            {
                "data": files(data),
                "holdout": files(holdout),
                "parameters": parameters,
                "model": model,
                "options": key_values(options, "--options"),
                "overrides": key_values(override, "--override"),
                "scale": scale,
                "ambient_c": temperature,
                "search": search,
                "effects": effect,
                "backend": backend,
                "max_effects": max_effects,
                "seed": seed,
                "out": out,
            }
        )
    except ValidationError as error:
        raise explain(error, "discovery", DiscoverOptions) from None
    found = find(asked, lambda text: print(printable(text, 400), file=sys.stderr, flush=True))
    print(f"verdict: {found.verdict}")
    for name in found.names:
        print(f"  {printable(name)}")
    print(f"  report: {out / 'report.html'}")
